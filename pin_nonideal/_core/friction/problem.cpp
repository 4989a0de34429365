#include "friction/problem.hpp"

#include <cmath>
#include <utility>

#include "dynamics/acceleration.hpp"
#include "math/decompositions.hpp"
#include "math/tolerances.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

static const Block& block_of(const Program& p, int element) { return p.blocks[p.frictions[element].block]; }

// Call act(column) for each friction force. `force` is the generalized force of its unit, and act may change it.
template <class Act>
void FrictionProblem::each_unit_force(const Program& p, const Workspace& w, const Act& act) {
    int column = 0;
    for (int e : elements) {
        const Block& block = block_of(p, e);
        for (size_t k = 0; k < block.kept.size(); ++k, ++column) {
            force.setZero();
            unit[block.row + k] = 1.0;
            add_transpose(block, w.now.A, unit, force);
            unit[block.row + k] = 0.0;
            act(column);
        }
    }
}

FrictionProblem::FrictionProblem(const Program& p, Workspace& w, std::vector<int> list) : elements(std::move(list)) {
    for (int e : elements) {
        dims.push_back(p.frictions[e].dim);
        rows += dims.back();
    }
    W.resize(rows, rows);
    response.resize(p.mechanism.nv, rows);
    multipliers.resize(p.layout.rows, rows);
    free = VecX::Zero(rows);
    force = VecX::Zero(p.mechanism.nv);
    unit = lam = none = VecX::Zero(p.layout.rows);
    VecX a(p.mechanism.nv);
    each_unit_force(p, w, [&](int column) {
        solve_acceleration(p, w, force, none, a, lam);
        response.col(column) = a;
        multipliers.col(column) = lam;
        W.col(column) = along(p, w, a);
    });
}

bool FrictionProblem::has_unique_forces() const {
    std::vector<int> movable;
    for (int i = 0; i < rows; ++i)
        if (W(i, i) > 0.0) movable.push_back(i);
    if (movable.empty()) return true;
    const VecX scale = W.diagonal()(movable).cwiseSqrt().cwiseInverse();
    Cholesky factor;
    return factor.compute(scale.asDiagonal() * W(movable, movable) * scale.asDiagonal()) &&
           factor.factor().diagonal().cwiseAbs2().minCoeff() > parameters.min_pivot;
}

VecX FrictionProblem::along(const Program& p, Workspace& w, const VecX& x) const {
    VecX out(rows);
    int row = 0;
    for (int e : elements) {
        const Block& block = block_of(p, e);
        multiply(block, w.now.A, x, w.scratch.r);
        for (size_t k = 0; k < block.kept.size(); ++k) out[row++] = w.scratch.r[block.row + k];
    }
    return out;
}

VecX FrictionProblem::slip_accelerations(const Program& p, Workspace& w) const {
    VecX alpha = along(p, w, w.now.a);
    int row = 0;
    for (int e : elements) {
        const Block& block = block_of(p, e);
        for (size_t k = 0; k < block.kept.size(); ++k) alpha[row++] -= w.now.b[block.row + k];
    }
    return alpha;
}

void FrictionProblem::add_forces(const Program& p, Workspace& w, const VecX& f, VecX& C) const {
    VecX by_row = VecX::Zero(p.layout.rows);
    int row = 0;
    for (int e : elements) {
        const Block& block = block_of(p, e);
        for (size_t k = 0; k < block.kept.size(); ++k, ++row) by_row[block.row + k] = w.now.slip_force.change(e)[k] = f[row];
        add_transpose(block, w.now.A, by_row, C);
    }
    w.now.reactions.current = false;
}

void FrictionProblem::clean(const Program& p, Workspace& w) {
    W = (0.5 * (W + W.transpose())).eval();
    each_unit_force(p, w, [&](int i) {
        solve_R(p.mechanism, w.now.terms, force);
        free[i] = force.squaredNorm();
        if (W(i, i) > min_constrained_response * free[i]) return;  // else the response is rounding error
        W.row(i).setZero();
        W.col(i).setZero();
    });
}

void FrictionProblem::unload_held(const Program& p, Workspace& w) {
    if (W.diagonal().all()) return;
    force = w.now.F;
    solve_R(p.mechanism, w.now.terms, force);
    const double of_forces = force.norm(), of_motion = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
    for (int i = 0; i < rows; ++i) {
        const double noise = relative_acceleration_rounding * (of_motion + std::sqrt(free[i]) * of_forces);
        if (W(i, i) == 0.0 && std::abs(alpha0[i]) <= noise) alpha0[i] = 0.0;
    }
}

}  // namespace pn
