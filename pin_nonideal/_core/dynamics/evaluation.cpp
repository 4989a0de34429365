#include "dynamics/evaluation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/given_forces.hpp"
#include "dynamics/implicit_friction.hpp"
#include "dynamics/acceleration.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

static void factor_mass(const Program& p, Workspace& w, double t) {
    const int dof = factorize(p.mechanism, w.now.terms);
    if (dof < 0) return;
    const Mechanism& m = p.mechanism;
    const double inertia = m.is_deep[dof] ? w.now.terms.D[dof] : w.now.terms.M[m.row_offset[dof]];
    if (!w.now.terms.q.allFinite() || !(inertia < evaluation_parameters.runaway_inertia))
        throw Failure(Failure::Kind::not_finite, t);
    throw Failure(Failure::Kind::singular_mass, t, {dof});
}

void evaluate_residuals(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    place_bodies(p.mechanism, w.now.terms, q, p.constrained_joints, p.constrained_angles);
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    for (int i : w.now.active_blocks)
        if (i < p.constraints) evaluate(p.blocks[i].kind, state, Part::residual, w.now.values[i]);
}

// Compute residuals and A, Eq. (3), and users' own b.
void place_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    if (w.now.active_blocks.empty()) return;
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    for (int i : w.now.active_blocks) {
        const Block& block = p.blocks[i];
        RowValues& values = w.now.values[i];
        evaluate(block.kind, state, Part::place, values);
        if (values.has_A) continue;
        fill_A(block, p.mechanism, w.now.terms, values, w.now.A.data() + block.offset);
        values.has_A = values.constant_A;
    }
}

// Compute rates and b, Eq. (3).
static void move_rows(const Program& p, Workspace& w, double t, const VecX& v) {
    if (w.now.active_blocks.empty()) return;
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    for (int i : w.now.active_blocks) {
        const Block& block = p.blocks[i];
        RowValues& values = w.now.values[i];
        evaluate(block.kind, state, Part::motion, values);
        for (size_t k = 0; k < block.kept.size(); ++k)
            w.now.b[block.row + k] = w.now.frozen ? 0.0 : -values.bias[block.kept[k]];  // Eq. (3)
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
    factor_rows(p.blocks, w.now.B, w.now.rows);
    ++w.counters.factorizations;
    w.now.rows.refine = w.now.terms.D.maxCoeff() > evaluation_parameters.refined_pivot_ratio * w.now.terms.D.minCoeff();
}

void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    w.now.renew();
    place_bodies(p.mechanism, w.now.terms, q);
    mass_matrix(p.mechanism, w.now.terms);
    if (w.now.drives.active) w.now.drives.add_inertia(p.mechanism, w.now.terms);
    factor_mass(p, w, t);
    if (!p.blocks.empty()) factor_placed_rows(p, w, t, v);
}

void place(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    w.now.renew();
    place_bodies(p.mechanism, w.now.terms, q);
    mass_matrix(p.mechanism, w.now.terms);
    place_rows(p, w, t, v);
}

void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v) {
    if (!p.affine_rates) factor_placed_rows(p, w, t, v);
}

// Split F for the solution: in deep trees the bias and the given forces on bodies are wrenches.
static void place_wrenches(const Program& p, Workspace& w) {
    Evaluation& now = w.now;
    now.joint_F = now.F;
    for (int dof : p.mechanism.deep_dofs)
        now.joint_F[dof] = p.driven || now.has_override ? now.tau[dof] + now.joint_external[dof] : 0.0;
    for (int i : p.mechanism.deep_joints) {
        now.wrench[i] = -1.0 * now.terms.deep.bias[i];
        if (p.has_body_forces) now.wrench[i] += now.body_force[i];
    }
}

void assemble_forces(const Program& p, Workspace& w, double t, const VecX& v) {
    if (++w.counters.evaluations % evaluation_parameters.evaluations_per_watch == 0 && w.watch) w.watch(t);
    move_bodies(p.mechanism, w.now.terms, v);
    bias_forces(p.mechanism, w.now.terms);
    w.now.F = -w.now.terms.nle;
    if (p.driven || w.now.has_override) {
        given_forces(p, w, t, w.now.terms.q, v);
        w.now.F += w.now.tau + w.now.external;
    }
    if (w.now.drives.active) w.now.F += w.now.drives.force;
    if (!p.mechanism.deep_dofs.empty()) place_wrenches(p, w);
    if (!p.blocks.empty()) move_rows(p, w, t, v);
}

// Check if closed contacts balance the load. The acceleration a is then rounding: M a is below the rounding error of the
// summed forces.
static bool is_balanced(const Program& p, Workspace& w) {
    if (w.now.closed_gaps.empty() || p.moves_in_time) return false;
    if (w.now.a.cwiseAbs().maxCoeff() <= evaluation_parameters.balance_rounding * p.mechanism.gravity.norm()) return true;
    VecX &left = w.scratch.work, &size = w.scratch.trial;
    multiply_M(p.mechanism, w.now.terms, w.now.a, left);
    size = w.now.F.cwiseAbs();
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        const double* entry = w.now.A.data() + block.offset;
        for (int dof : block.support())
            for (size_t k = 0; k < block.kept.size(); ++k) size[dof] += std::abs(*entry++ * w.now.lam[block.row + k]);
    }
    return (left.cwiseAbs().array() <= evaluation_parameters.residual_sum_rounding * size.array()).all();
}

// Set the results of the laws if no law acts.
static void reset_laws(Workspace& w) {
    std::fill_n(w.now.C.data(), w.now.C.size(), 0.0);
    std::fill_n(w.now.C_smooth.data(), w.now.C_smooth.size(), 0.0);
    w.state.unique = Uniqueness::shown;
}

void solve_dynamics(const Program& p, Workspace& w, double t, const VecX& v) {
    if (p.has_laws()) {
        std::copy_n(v.data(), v.size(), w.now.v.data());
        w.now.speed = 0.0;
        for (int k = 0; k < v.size(); ++k) w.now.speed = std::max(w.now.speed, std::abs(v[k]));
    }
    if (!laws_act(p, w)) {
        solve_motion(p, w, false);
        if (p.has_laws()) reset_laws(w);
    } else {
        find_known_forces(p, w, t, w.now.terms.q, v);
        solve_with_laws(p, w, t, w.now.terms.q, v, w.now.C_smooth);
    }
    if (!w.now.a.allFinite()) throw Failure(Failure::Kind::not_finite, t);
    if ((v.array() == 0.0).all() && (is_immobile(p, w) || is_balanced(p, w))) w.now.a.setZero();
}

void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    assemble_forces(p, w, t, v);
    solve_dynamics(p, w, t, v);
}

void evaluate_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap) {
    evaluate_block(p, w, t, v, p.gaps[gap].block);
}

void evaluate_block(const Program& p, Workspace& w, double t, const VecX& v, int i) {
    const Block& block = p.blocks[i];
    RowValues& values = w.now.values[i];
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    evaluate(block.kind, state, Part::place, values);
    evaluate(block.kind, state, Part::motion, values);
    if (!values.has_A) fill_A(block, p.mechanism, w.now.terms, values, w.now.A.data() + block.offset);
    values.has_A = values.constant_A;
}

void move_block(const Program& p, Workspace& w, double t, const VecX& v, int i) {
    if (p.has_user_rows) return evaluate_block(p, w, t, v, i);
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    evaluate(p.blocks[i].kind, state, Part::motion, w.now.values[i]);
}

void measure_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap) {
    if (p.is_users(gap)) return evaluate_gap(p, w, t, v, gap);
    const int i = p.gaps[gap].block;
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    evaluate(p.blocks[i].kind, state, Part::residual, w.now.values[i]);
}

double measured_width(const Program& p, Workspace& w, double t, const VecX& v, int gap) {
    const int i = p.gaps[gap].block;
    if (p.is_users(gap) || w.now.values.has_storage(i)) {
        measure_gap(p, w, t, v, gap);
        return w.now.values[i].residual[0];
    }
    RowValues& passing = w.scratch.passing_gap;
    passing.resize(w.now.values.storage(i), p.mechanism.nv);
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    evaluate(p.blocks[i].kind, state, Part::residual, passing);
    const double width = passing.residual[0];
    if (!(width > 0.0)) std::swap(w.now.values[i], passing);
    return width;
}

void follow_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap) {
    measure_gap(p, w, t, v, gap);
    move_gap(p, w, t, v, gap);
}

void move_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap) {
    if (p.is_users(gap)) return;
    const int i = p.gaps[gap].block;
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    evaluate(p.blocks[i].kind, state, Part::motion, w.now.values[i]);
}

// Penetrations of all gaps and rates of closed ones. Open gaps are measured here.
static void gap_violations(const Program& p, Workspace& w, double t, const VecX& v, double& position, double& velocity,
                           const std::vector<char>* open_gaps) {
    const auto add = [&](int i) {
        if (!w.state.closed[i]) {
            position = std::max(position, -measured_width(p, w, t, v, i));
            return;
        }
        const RowValues& values = w.now.values[p.gaps[i].block];
        velocity = std::max(velocity, std::abs(values.rate[0]));
        position = std::max(position, -values.residual[0]);
    };
    const size_t count = p.gaps.size();
    if (open_gaps)
        for (size_t i = next_other(*open_gaps, 0, char(1)); i < count; i = next_other(*open_gaps, i + 1, char(1)))
            add(static_cast<int>(i));
    else
        for (size_t i = 0; i < count; ++i) add(static_cast<int>(i));
}

void violations(const Program& p, Workspace& w, double t, const VecX& v, double& position, double& velocity,
                const std::vector<char>* open_gaps) {
    position = velocity = 0.0;
    for (int i = 0; i < p.first_gap; ++i) {
        const RowValues& values = w.now.values[i];
        for (int k = 0; k < values.rows; ++k) {
            position = std::max(position, std::abs(values.residual[k]));
            velocity = std::max(velocity, std::abs(values.rate[k]));
        }
    }
    gap_violations(p, w, t, v, position, velocity, open_gaps);
}

}  // namespace pn
