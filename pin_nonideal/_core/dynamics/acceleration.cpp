#include "dynamics/acceleration.hpp"

#include "tree/mass_factor.hpp"

namespace pn {

// Pivots of M that differ by more than RowSystem::refine allows reduce the accuracy of the row equations. These
// refinement passes restore it.
constexpr int refinement_passes = 2;

void scale_rows(const Program& p, Workspace& w) {
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        scale_rows(p.mechanism, w.now.terms, block, w.now.values[i], w.now.A.data() + block.offset,
                   w.now.B.data() + block.offset);  // Eq. (7)
    }
}

void choose_rows(const Program& p, Workspace& w, double tolerance, int max_rank) {
    decide_rows(p.mechanism, w.now.terms, p.blocks, w.now.values, w.now.B, w.now.rows, tolerance, max_rank);
    factor_rows(p.blocks, w.now.B, w.now.rows);
}

// Compute r := b - A x, or b - B x with the scaled rows, for the rows in use.
static PN_INLINE void row_residuals(const Program& p, const Evaluation& now, const RowEntries& rows, const VecX& x,
                          const VecX& b, VecX& r) {
    for (int i : now.rows.blocks) {
        const Block& block = p.blocks[i];
        multiply(block, rows, x, r);
        for (size_t k = 0; k < block.kept.size(); ++k) r[block.row + k] = b[block.row + k] - r[block.row + k];
    }
}

// Add B^T lam to x = R^-1 (F + C).
static PN_INLINE void follow_rows(const Program& p, Workspace& w, VecX& x, const VecX& b, VecX& lam) {
    Evaluation& now = w.now;
    if (now.rows.blocks.empty()) return;
    row_residuals(p, now, now.B, x, b, w.scratch.r);
    solve_rows(now.rows, w.scratch.r, lam);  // J B^T (b - B a_s') = B^T lam, Eqs. (38), (39)
    for (int i : now.rows.blocks) add_transpose(p.blocks[i], now.B, lam, x);  // scaled, Eq. (40)
}

static PN_INLINE void solve_scaled_motion(const Program& p, Workspace& w, VecX& x, const Force* body, const VecX& b,
                                          VecX& lam) {
    solve_R(p.mechanism, w.now.terms, x, body);  // a_s' = R^-1 (F + C), Eq. (5)
    follow_rows(p, w, x, b, lam);
}

double solve_scaled(const Program& p, Workspace& w, VecX& x, const Force* body, const VecX& b, VecX& lam) {
    solve_R(p.mechanism, w.now.terms, x, body);
    const double free = x.squaredNorm();
    follow_rows(p, w, x, b, lam);
    return free;
}

// Turn the force x into the acceleration under x and the constraints A a = b. Also compute their multipliers lam.
static PN_INLINE void constrained_solve(const Program& p, Workspace& w, VecX& x, const Force* body, const VecX& b,
                                        VecX& lam) {
    solve_scaled_motion(p, w, x, body, b, lam);
    solve_Rt(p.mechanism, w.now.terms, x);  // without rows a = M^-1 F, Eq. (1)
}

// Compute force + A^T lam - M a in w.scratch.scaled_free. Bodies of deep trees have their part in body_residual.
static void force_residual(const Program& p, Workspace& w, const VecX& force, const Force* body, const VecX& a,
                           const VecX& lam) {
    Evaluation& now = w.now;
    Scratch& scratch = w.scratch;
    if (p.mechanism.deep_dofs.empty()) {
        multiply_M(p.mechanism, now.terms, a, scratch.scaled);
        scratch.scaled_free = force - scratch.scaled;
        for (int i : now.rows.blocks) add_transpose(p.blocks[i], now.A, lam, scratch.scaled_free);
        return;
    }
    multiply_M(p.mechanism, now.terms, a, scratch.scaled, scratch.body_inertia.data());
    scratch.scaled_free = force - scratch.scaled;
    for (int i : p.mechanism.deep_joints) {
        scratch.body_residual[i] = body ? body[i] : Force{};
        scratch.body_residual[i] -= scratch.body_inertia[i];
    }
    for (int i : now.rows.blocks)
        add_transpose(p.blocks[i], p.mechanism, now.terms, now.values[i], now.A, lam, scratch.scaled_free,
                      scratch.body_residual);
}

void solve_acceleration(const Program& p, Workspace& w, const VecX& force, const VecX& b, VecX& a, VecX& lam,
                        const std::vector<Force>* body) {
    Evaluation& now = w.now;
    Scratch& scratch = w.scratch;
    a = force;
    constrained_solve(p, w, a, body ? body->data() : nullptr, b, lam);
    if (now.rows.blocks.empty() || !now.rows.refine) return;
    for (int pass = 0; pass < refinement_passes; ++pass) {  // each pass solves for the residual of the last one
        force_residual(p, w, force, body ? body->data() : nullptr, a, lam);
        row_residuals(p, now, now.A, a, b, scratch.residual);
        constrained_solve(p, w, scratch.scaled_free, scratch.body_residual.data(), scratch.residual, scratch.lam_step);
        a += scratch.scaled_free;
        lam += scratch.lam_step;
    }
}

void solve_motion(const Program& p, Workspace& w, bool with_laws, const VecX& b, VecX& a, VecX& lam) {
    const bool deep = !p.mechanism.deep_dofs.empty();
    const VecX& force = deep ? w.now.joint_F : w.now.F;
    if (with_laws) w.scratch.trial = force + w.now.C;
    solve_acceleration(p, w, with_laws ? w.scratch.trial : force, b, a, lam, deep ? &w.now.wrench : nullptr);
}

void solve_motion(const Program& p, Workspace& w, bool with_laws) {
    w.now.renew();
    solve_motion(p, w, with_laws, w.now.b, w.now.a, w.now.lam);
}

bool is_immobile(const Program& p, const Workspace& w) {
    if (p.moves_in_time || (p.frictions.empty() && p.gaps.empty())) return false;
    int held_count = 0;
    for (char locked : w.now.terms.locked) held_count += locked;
    bool sticks = held_count > 0;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k) held_count += w.now.rows.active[block.row + k];
        sticks |= i >= p.first_gap;
    }
    return sticks && held_count >= p.mechanism.nv;
}

const VecX& holding_forces(const Program& p, Workspace& w) {
    Evaluation& now = w.now;
    if (now.has_holding) return now.holding;
    now.has_holding = true;
    multiply_M_locked(p.mechanism, now.terms, now.a, now.holding);
    now.holding -= now.F + now.C;
    w.scratch.work.setZero();
    for (int i : now.rows.blocks) add_transpose(p.blocks[i], now.A, now.lam, w.scratch.work);
    now.holding -= w.scratch.work;  // F_c = M a - F, Eq. (4), minus the forces of rows and laws
    return now.holding;
}

}  // namespace pn
