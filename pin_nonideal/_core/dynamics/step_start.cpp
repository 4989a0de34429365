#include "dynamics/step_start.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dynamics/evaluation.hpp"
#include "dynamics/state_projection.hpp"
#include "dynamics/acceleration.hpp"
#include "tree/mass_factor.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Length of x in the metric of M, restricted to the constrained dofs.
static double scaled_length(const Program& p, Workspace& w, const VecX& x) {
    VecX& scaled = w.scratch.scaled;
    multiply_M(p.mechanism, w.now.terms, x, scaled);
    for (int dof = 0; dof < p.mechanism.nv; ++dof)
        if (w.now.terms.locked[dof]) scaled[dof] = 0.0;
    solve_R(p.mechanism, w.now.terms, scaled);
    double square = 0.0;
    for (int dof : p.constrained_dofs) square += scaled[dof] * scaled[dof];
    return std::sqrt(square);
}

// Angular speed [rad/s] of the body with the fastest rotation.
static double fastest_turn(const Workspace& w) {
    double square = 0.0;
    for (const Body& body : w.now.terms.body) square = std::max(square, body.v.ang.squaredNorm());
    return std::sqrt(square);
}

// Residual allowed to a dependent row of unit length besides its own terms. The first part is a fraction of the
// rotational accelerations, which may cancel in each term. The second part applies while elements stick. This part is the
// effect of the motion on the row's independent component, which is below the rank tolerance.
static double unseen(const Program& p, Workspace& w, const VecX& v) {
    const double speed = scaled_length(p, w, v);
    const double turning =
        step_start_parameters.consistency_tolerance * step_start_parameters.background * speed * fastest_turn(w);
    if (!w.state.sticks_anywhere()) return turning;
    return turning + step_start_parameters.dependence_growth * w.state.rank_tolerance *
                         (scaled_length(p, w, w.now.a) + speed * v.cwiseAbs().maxCoeff());
}

// Largest centripetal acceleration along a rounded edge of the closed contacts. The terms of a gap's bias are as large, and
// may cancel.
static double centripetal_acceleration(const Program& p, const Workspace& w) {
    double largest = 0.0;
    for (int gap : w.now.closed_gaps) {
        const int i = p.gaps[gap].block;
        const Block& block = p.blocks[i];
        double radius = HUGE_VAL;
        visit_as<ShapeGap>(block.kind, [&](const auto& k) { radius = k.max_depth(); });
        if (!(radius < HUGE_VAL) || block.kept.empty()) continue;
        const Vec3& point = w.now.values[i].wrench[0].point;
        const auto velocity = [&](int joint) {
            return joint == 0 ? Vec3(Vec3::Zero()) : velocity_at(w.now.terms.body[joint], point);
        };
        largest = std::max(largest, (velocity(block.joint1) - velocity(block.joint2)).squaredNorm() / radius);
    }
    return largest;
}

// Find the block with the largest residual of its dependent rows. Return -1 if the motion satisfies all dependent rows.
static int contradicting_block(const Program& p, Workspace& w, const VecX& v, double& worst) {
    int worst_block = -1;
    double excess = 1.0, turning = 0.0;
    std::optional<double> lacking;  // for a row of unit length
    const double reach = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm() +
                         step_start_parameters.background;  // scale of accelerations
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        const int n = static_cast<int>(block.kept.size());
        for (int k = 0; k < n; ++k) {
            const int row = block.row + k;
            if (!w.now.rows.required[row] || w.now.rows.active[row]) continue;
            double sum = -w.now.b[row], size = std::abs(w.now.b[row]);
            const double* A = w.now.A.data() + block.offset + k;
            for (size_t l = 0; l < block.support().size(); ++l) {
                const double term = A[l * n] * w.now.a[block.support()[l]];
                sum += term;
                size += std::abs(term);
            }
            double allowed =
                step_start_parameters.consistency_tolerance * (size + step_start_parameters.background * reach);
            if (std::abs(sum) <= allowed * excess) continue;
            if (!lacking) {
                lacking = unseen(p, w, v);
                turning = step_start_parameters.consistency_tolerance * step_start_parameters.background *
                          centripetal_acceleration(p, w);
            }
            allowed += *lacking / w.now.rows.chosen_scale[row] + turning;
            if (std::abs(sum) > allowed * excess) {
                excess = std::abs(sum) / allowed;
                worst = sum;
                worst_block = i;
            }
        }
    }
    return worst_block;
}

static void choose_rows_anew(const Program& p, Workspace& w, int max_rank = INT_MAX) {
    choose_rows(p, w, w.state.rank_tolerance, max_rank);
    ++w.counters.factorizations;
}

int max_rank_near(const Workspace& w) {
    return w.now.dependent_at_start > 0 ? w.now.rows.required_count() - w.now.dependent_at_start : INT_MAX;
}

bool configure_step(const Program& p, Workspace& w, int max_rank) {
    w.state.has_ideal_row_choice = false;
    if (w.now.rows.blocks.empty()) return false;
    const RowSystem& rows = w.now.rows;
    const bool due = w.now.closed_gaps.empty() && is_choice_due(w.now.rows);  // contacts are chosen with their modes
    if (!rows.orthogonal && !due && rows.has_rank_up_to(max_rank)) return false;
    // The Cholesky factor proves that the active rows are independent: a new choice has at most as many.
    if (!rows.orthogonal) max_rank = std::min(max_rank, rows.active_count());
    choose_rows_anew(p, w, max_rank);
    return true;
}

// Throw a failure that names the contradicting block and the other block with the largest multipliers.
[[noreturn]] static void contradict(const Program& p, const Workspace& w, double t, int block, double residual) {
    std::vector<int> blame{block};
    double largest = -1.0;
    int other = -1;
    for (int i : w.now.rows.blocks) {
        if (i == block) continue;
        const double size = w.now.lam.segment(p.blocks[i].row, p.blocks[i].kept.size()).cwiseAbs().maxCoeff();
        if (size > largest) { largest = size; other = i; }
    }
    if (other >= 0) blame.push_back(other);
    throw Failure(Failure::Kind::inconsistent, t, blame, residual);
}

// Evaluate laws after the rows are independent. Dependent rows would pass meaningless multipliers to the laws.
void continue_step(const Program& p, Workspace& w, double t, const VecX& v, bool chosen) {
    assemble_forces(p, w, t, v);
    solve_dynamics(p, w, t, v);
    if (w.now.rows.blocks.empty() || !w.now.rows.redundant) return;
    double residual = 0.0;
    int block = contradicting_block(p, w, v, residual);
    if (block >= 0 && !chosen) {  // dependent rows of an earlier step may be independent now
        choose_rows_anew(p, w);
        solve_dynamics(p, w, t, v);
        block = contradicting_block(p, w, v, residual);
    }
    if (block >= 0) contradict(p, w, t, block, residual);
}

void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    configure(p, w, t, q, v);
    continue_step(p, w, t, v, configure_step(p, w));
}

// Fraction of the kinetic energy of v that the rows in use would remove.
static double removed_energy_part(const Program& p, Workspace& w, double t, const VecX& v) {
    VecX kept = v;
    project_velocity(p, w, t, kept);
    const double before = kinetic_energy(p.mechanism, w.now.terms, v);
    const double after = kinetic_energy(p.mechanism, w.now.terms, kept);
    configure_velocity(p, w, t, v);
    return before > 0.0 ? std::abs(before - after) / before : 0.0;
}

void restore_motion(const Program& p, Workspace& w, double t, const VecX& v) {
    const bool near_singular = !w.now.closed_gaps.empty() && w.now.rows.distance < near_singular_pivot;
    const bool may_stop = w.state.sticks_anywhere() ? w.now.rows.redundant : near_singular;
    if (!may_stop || v.cwiseAbs().maxCoeff() <= immobile_speed) return;
    const auto choose = [&](double tolerance) {
        w.state.rank_tolerance = tolerance;
        choose_rows_anew(p, w);
        continue_step(p, w, t, v, true);
    };
    const double first_tolerance = w.state.rank_tolerance;
    double tolerance = first_tolerance;
    while (tolerance < step_start_parameters.max_unheld_part &&
           removed_energy_part(p, w, t, v) > step_start_parameters.max_removed_energy_part)
        choose(tolerance *= step_start_parameters.unheld_growth);
    if (tolerance >= step_start_parameters.max_unheld_part) choose(first_tolerance);
}

bool begin_rows(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, int max_rank) {
    configure(p, w, t, q, v);
    return configure_step(p, w, max_rank);
}

void begin_rows_inside(const Program& p, Workspace& w, double t0, const VecX& q0, double t, const VecX& q,
                       const VecX& v) {
    const RowSystem& rows = w.now.rows;
    configure(p, w, t, q, v);
    if (rows.blocks.empty() || (!rows.orthogonal && w.now.dependent_at_start == 0)) return;
    begin_rows(p, w, t0, q0, v);
    const int rank = rows.active_count();
    w.now.dependent_at_start = rows.required_count() - rank;
    configure(p, w, t, q, v);
    if (rows.orthogonal) choose_rows_anew(p, w, rank);
}

void project_into_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    begin_rows(p, w, t, q, v);
    project(p, w, t, q, v);
}

bool meet_rates(const Program& p, Workspace& w, double t, VecX& v) {
    if (w.state.steps_since != undecided_steps) ++w.state.steps_since;
    return project_velocity(p, w, t, v);
}

bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v) {
    const bool chosen = configure_step(p, w);
    const bool moved = meet_rates(p, w, t, v);
    continue_step(p, w, t, v, chosen);
    return moved;
}

}  // namespace pn
