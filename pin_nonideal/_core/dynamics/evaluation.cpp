#include "dynamics/evaluation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/given_forces.hpp"
#include "dynamics/implicit.hpp"
#include "dynamics/solution.hpp"
#include "tree/factor.hpp"

namespace pn {

// Pivots of M that differ by more than this (bodies of very unequal mass, or massless ones) cost the row equations
// the same factor in accuracy, which refinement gives back.
constexpr double refined_pivot_ratio = 1e6;
// A configuration that gives a larger inertia [kg m^2] has run away.
constexpr double runaway_inertia = 1e30;

static void factor_mass(const Program& p, Workspace& w, double t) {
    const int dof = factorize(p.mechanism, w.now.terms);
    if (dof < 0) return;
    if (!w.now.terms.q.allFinite() || !(w.now.terms.M[p.mechanism.row_offset[dof]] < runaway_inertia))
        throw Failure(Failure::Kind::not_finite, t);
    throw Failure(Failure::Kind::singular_mass, t, {dof});
}

void evaluate_residuals(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    place_bodies(p.mechanism, w.now.terms, q, p.constrained_joints, p.constrained_angles);
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (int i = 0; i < p.constraints; ++i) evaluate(p.blocks[i].kind, state, Part::residual, w.now.values[i]);
}

// Residuals and A, Eq. (3); and the users' own b.
static void place_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (size_t i = 0; i < p.blocks.size(); ++i) {
        const Block& block = p.blocks[i];
        RowValues& values = w.now.values[i];
        evaluate(block.kind, state, Part::place, values);
        if (values.has_A) continue;
        fill_A(block, w.now.terms, values, w.now.A.data() + block.offset);
        values.has_A = values.constant_A;
    }
}

// Rates and b, Eq. (3).
static void move_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (size_t i = 0; i < p.blocks.size(); ++i) {
        const Block& block = p.blocks[i];
        RowValues& values = w.now.values[i];
        evaluate(block.kind, state, Part::motion, values);
        for (size_t k = 0; k < block.kept.size(); ++k)
            w.now.b[block.row + k] = -values.drift[block.kept[k]];  // Eq. (3)
    }
}

void evaluate_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    place_rows(p, w, t, v);
    move_rows(p, w, t, v);
}

void update_kinematics(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    kinematics(p.mechanism, w.now.terms, q, v);
    evaluate_rows(p, w, t, v);
}

static void factor_placed_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    place_rows(p, w, t, v);
    if (w.now.rows.blocks.empty()) return;
    scale_rows(p, w);
    factor_rows(p.layout, p.blocks, w.now.B, w.now.rows);
    ++w.counters.factorizations;
    w.now.rows.refine = w.now.terms.D.maxCoeff() > refined_pivot_ratio * w.now.terms.D.minCoeff();
}

void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    w.now.renew();
    place_bodies(p.mechanism, w.now.terms, q);
    mass_matrix(p.mechanism, w.now.terms);
    factor_mass(p, w, t);
    if (!p.blocks.empty()) factor_placed_rows(p, w, t, v);
}

void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v) {
    if (!p.affine_rates) factor_placed_rows(p, w, t, v);
}

void assemble_forces(const Program& p, Workspace& w, double t, const VecX& v) {
    ++w.counters.evaluations;
    move_bodies(p.mechanism, w.now.terms, v);
    bias_forces(p.mechanism, w.now.terms);
    w.now.F = -w.now.terms.nle;
    if (p.driven || w.now.has_override) {
        given_forces(p, w, t, w.now.terms.q, v);
        w.now.F += w.now.tau + w.now.external;
    }
    if (!p.blocks.empty()) move_rows(p, w, t, v);
}

void solve_dynamics(const Program& p, Workspace& w, double t, const VecX& v) {
    if (!p.has_laws()) {
        solve_acceleration(p, w, w.now.F);
    } else {
        w.now.v = v;
        w.now.speed = v.cwiseAbs().maxCoeff();
        find_known_forces(p, w, t, w.now.terms.q, v);
        solve_with_laws(p, w, t, w.now.terms.q, v, w.now.C_smooth);
    }
    if (!w.now.a.allFinite()) throw Failure(Failure::Kind::not_finite, t);
    if (is_immobile(p, w) && (v.array() == 0.0).all()) w.now.a.setZero();
}

void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    assemble_forces(p, w, t, v);
    solve_dynamics(p, w, t, v);
}

void violations(const Program& p, const Workspace& w, double& position, double& velocity) {
    position = velocity = 0.0;
    for (int i = 0; i < p.constraints; ++i) {
        const RowValues& values = w.now.values[i];
        for (int k = 0; k < values.rows; ++k) {
            position = std::max(position, std::abs(values.residual[k]));
            velocity = std::max(velocity, std::abs(values.rate[k]));
        }
    }
}

}  // namespace pn
