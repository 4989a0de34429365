#include "contact/contact_rows.hpp"

#include <utility>

#include "dynamics/evaluation.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

static void free_contacts(const Program& p, Workspace& w, const std::vector<char>& touching,
                          const std::vector<Mode>& modes) {
    set_closed(p, w, touching);
    set_modes(p, w, modes);
    for (const Gap& gap : p.gaps)
        for (size_t k = 0; k < p.blocks[gap.block].kept.size(); ++k)
            w.now.rows.required[p.blocks[gap.block].row + k] = 0;
    w.now.rows.use_required(p.layout, p.blocks, w.now.active_blocks);
}

void free_contacts(const Program& p, Workspace& w, const std::vector<char>& touching) {
    free_contacts(p, w, touching, std::vector<Mode>(p.frictions.size(), unloaded));
}

void release_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                      const std::vector<char>& touching) {
    release_contacts(p, w, t, q, v, touching, std::vector<Mode>(p.frictions.size(), unloaded));
}

void release_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                      const std::vector<char>& touching, const std::vector<Mode>& modes) {
    free_contacts(p, w, touching, modes);
    begin_step(p, w, t, q, v);
}

ContactRows::ContactRows(const Program& program, Workspace& workspace, const std::vector<int>& list, bool rub,
                         std::vector<int> more)
    : p(program), w(workspace), gaps(list), others(std::move(more)) {
    int rows = 0;
    for (int gap : gaps) {
        const int sliding = rub ? p.gaps[gap].sliding : -1;
        const int slips = sliding < 0 ? 0 : static_cast<int>(p.blocks[p.frictions[sliding].block].kept.size());
        first.push_back(rows);
        cones.push_back(ConeElement::contact(1 + slips, sliding < 0 ? 0.0 : p.frictions[sliding].mu));
        rows += 1 + slips;
    }
    for (int e : others) {
        first.push_back(rows);
        cones.push_back(ConeElement::box(p.frictions[e].dim, 0.0));
        rows += p.frictions[e].dim;
    }
    W.setZero(rows, rows);
    response.setZero(p.mechanism.nv, rows);
    velocity.setZero(rows);
    respond();
}

void ContactRows::respond() {
    const int nv = p.mechanism.nv;
    const VecX no_bias = VecX::Zero(p.layout.rows);
    VecX unit = no_bias, lam = no_bias, force(nv), motion(nv);
    each_row([&](int row, int block, int k) {
        const Block& row_block = p.blocks[block];
        velocity[row] = w.now.values[block].rate[row_block.kept[k]];
        force.setZero();
        unit[row_block.row + k] = 1.0;
        add_transpose(row_block, w.now.A, unit, force);
        unit[row_block.row + k] = 0.0;
        solve_acceleration(p, w, force, no_bias, motion, lam);
        response.col(row) = motion;
    });
    for (int column = 0; column < W.cols(); ++column) W.col(column) = change(response.col(column));
    W = (0.5 * (W + W.transpose())).eval();
}

VecX ContactRows::change(const VecX& dv) const {
    VecX out(velocity.size());
    each_row([&](int row, int block, int k) {
        multiply(p.blocks[block], w.now.A, dv, w.scratch.r);
        out[row] = w.scratch.r[p.blocks[block].row + k];
    });
    return out;
}

}  // namespace pn
