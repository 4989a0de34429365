#include "dynamics/force_decomposition.hpp"

#include "constraints/redundancy.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/acceleration.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

IdealMotion::IdealMotion(const Program& program, Workspace& workspace) : p(program), w(workspace) {
    for (Mode mode : w.state.mode) sticks |= mode == sticking;
    if (sticks) {
        w.now.terms.locked.swap(w.scratch.ideal_locked);
        factorize(p.mechanism, w.now.terms);
        std::swap(w.now.rows, w.now.ideal_rows);
        const RowSystem& ideal_system = w.now.ideal_rows;
        w.now.rows.refine = ideal_system.refine;
        if (!w.state.has_ideal_row_choice) {
            for (int r = 0; r < p.layout.rows; ++r)
                w.now.rows.required[r] = ideal_system.required[r] && r < p.constraint_rows();
            w.now.rows.use_required(p.layout, p.blocks, w.now.active_blocks);
        }
        if (!w.now.rows.blocks.empty()) {
            scale_rows(p, w);
            if (w.state.has_ideal_row_choice) factor_rows(p.blocks, w.now.B, w.now.rows);
            else choose_rows(p, w);
        }
        w.state.has_ideal_row_choice = true;
    }
    solve_motion(p, w, false);
    w.now.ideal = true;
}

IdealMotion::~IdealMotion() {
    w.now.ideal = false;
    w.now.renew();
    if (!sticks) return;
    w.now.terms.locked.swap(w.scratch.ideal_locked);
    factorize(p.mechanism, w.now.terms);
    std::swap(w.now.rows, w.now.ideal_rows);
    scale_rows(p, w);
}

void split_forces(const Program& p, Workspace& w, Split& out) {
    const int nv = p.mechanism.nv;
    const VecX a = w.now.a, lam = w.now.lam;
    VecX shared = reactions(p, w).lam;
    out.lam = p.user_multipliers(shared);
    out.C = p.has_laws() ? w.now.C : VecX(VecX::Zero(nv));
    VecX total = VecX::Zero(nv);
    for (size_t i = 0; i < p.blocks.size(); ++i) {
        if (!w.now.rows.block_used[i]) continue;
        const bool constraint = static_cast<int>(i) < p.constraints;
        // C includes the forces of sticking elements
        add_transpose(p.blocks[i], w.now.A, shared, constraint ? total : out.C);
    }
    VecX left_over = VecX::Zero(nv);  // locked dofs carry the forces of lam minus the shared multipliers
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.A, lam - shared, left_over);
    for (int dof = 0; dof < nv; ++dof)
        if (w.now.terms.locked[dof]) out.C[dof] += holding_forces(p, w)[dof] + left_over[dof];
    {
        const IdealMotion ideal(p, w);
        share_multipliers(p.blocks, w.now.B, p.described, w.now.rows, w.now.lam, shared);
        out.F_ideal = VecX::Zero(nv);
        for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.A, shared, out.F_ideal);
        if (w.now.rows.blocks.empty()) shared.setZero();
        out.lam_ideal = p.user_multipliers(shared);
    }
    out.F_nonideal = total - out.F_ideal + out.C;  // Eq. (39)
    w.now.a = a;
    w.now.lam = lam;
    w.now.renew();
}

}  // namespace pn
