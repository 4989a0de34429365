#include "dynamics/projection.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/acceleration.hpp"
#include "tree/mass_factor.hpp"
#include "tree/lie_group.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

// Compute x := B^T lam, the move R x of rows with multipliers lam in the metric of M.
void sum_rows(const Program& p, const Workspace& w, const VecX& lam, VecX& x) {
    x.setZero();
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.B, lam, x);
}

// Compute x := R^-T B^T (B B^T)^-1 r, the least move in the metric of M that changes A x by r.
void least_move(const Program& p, Workspace& w, VecX& x) {
    solve_rows(w.now.rows, w.scratch.r, w.scratch.lam_step);
    sum_rows(p, w, w.scratch.lam_step, x);
    solve_Rt(p.mechanism, w.now.terms, x);
}

// Largest change of the residual of a user's row by a displacement of unit length.
double row_size(const Program& p, const Workspace& w, const Block& block, size_t k) {
    double size = 0.0;
    const double* entry = w.now.A.data() + block.offset + k;
    for (size_t l = 0; l < block.support().size(); ++l, entry += block.kept.size())
        size = std::max(size, std::abs(*entry) / p.mechanism.lever[block.support()[l]]);
    return size;
}

// Factor that scales the residual of a user's row in other units to about the size of a residual in meters.
double unit_factor(const Program& p, const Workspace& w, const Block& block, size_t k) {
    const double size = row_size(p, w, block, k), small = projection_parameters.small_row;
    if (size == 0.0) return 1.0;
    return size < small ? small / size : size * small > 1.0 ? 1.0 / (small * size) : 1.0;
}

// Store the negative residual or rate of each kept row in r. Return the largest magnitude of the rows in `counts`.
template <class Value>
double gather(const Program& p, Workspace& w, const std::vector<char>& counts, Value value) {
    double largest = 0.0;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k) {
            const double x = value(i, static_cast<int>(k));
            w.scratch.r[block.row + k] = -x;
            if (!counts[block.row + k]) continue;
            const double size = block.affine_rate ? std::abs(x) : std::abs(x) * unit_factor(p, w, block, k);
            largest = std::max(largest, size);
        }
    }
    return largest;
}

double gather_residuals(const Program& p, Workspace& w, const std::vector<char>& counts) {
    return gather(p, w, counts, [&](int i, int k) { return w.now.values[i].residual[p.blocks[i].kept[k]]; });
}

double gather_residuals(const Program& p, Workspace& w) { return gather_residuals(p, w, w.now.rows.active); }

// Compute A v + phi_t from the rows in the workspace without motion of the bodies. A user's rate is a separate function.
double gather_rates(const Program& p, Workspace& w, double t, const VecX& v, const std::vector<char>& counts) {
    const State state{p.mechanism, w.now.terms, w.now.row_time(t), w.now.terms.q, v};
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        if (block.affine_rate) multiply(block, w.now.A, v, w.scratch.residual);
        else evaluate(block.kind, state, Part::motion, w.now.values[i]);
    }
    return gather(p, w, counts, [&](int i, int k) {
        const Block& block = p.blocks[i];
        const RowValues& values = w.now.values[i];
        if (!block.affine_rate) return values.rate[block.kept[k]];
        return w.scratch.residual[block.row + k] + values.phi_t[block.kept[k]];
    });
}

double gather_rates(const Program& p, Workspace& w, double t, const VecX& v) {
    return gather_rates(p, w, t, v, w.now.rows.active);
}

// Check if a new factorization pays off, assuming that each iteration reduces the residual as much as the last one.
bool needs_new_factors(double before, double now, double floor) {
    if (!(now < before)) return true;
    return std::log(now / std::max(floor, projection_parameters.no_floor)) / std::log(before / now) >
           projection_parameters.iterations_for_factors;
}

// Inner product of multipliers of rows of unit length.
double product(const Workspace& w, const VecX& x, const VecX& y) {
    double sum = 0.0;
    for (int k = 0; k < x.size(); ++k)
        if (w.now.rows.active[k]) sum += x[k] * y[k] / (w.now.rows.scale[k] * w.now.rows.scale[k]);
    return sum;
}

// Compute the next step of the multipliers, s := (B B^T)^-1 r with Broyden's corrections. The factors belong to the
// start of the move, and each step shows the change of the rows. [Kelley, Solving Nonlinear Equations with Newton's
// Method, 2003, sec. 4.3.]
void broyden_step(Workspace& w, int count) {
    VecX& step = w.scratch.position_lam_steps[count];
    step.resize(w.scratch.position_lam.size());
    solve_rows(w.now.rows, w.scratch.r, step);
    for (int j = 0; j < count; ++j) {
        const VecX& known = w.scratch.position_lam_steps[j];
        const double part = product(w, known, step) / product(w, known, known);
        if (!(std::abs(part) < projection_parameters.broyden_limit))
            return;  // rounding, or too far from the factorization
        if (j + 1 < count) step += part * w.scratch.position_lam_steps[j + 1];
        else step /= 1.0 - part;
    }
}

// Move q from position_start by R^-T B^T position_lam, on the given dofs.
template <class... Dofs>
void move_position(const Program& p, Workspace& w, VecX& q, const Dofs&... dofs) {
    sum_rows(p, w, w.scratch.position_lam, w.scratch.scaled);
    solve_Rt(p.mechanism, w.now.terms, dofs..., w.scratch.scaled);
    retract(p.mechanism, w.scratch.position_start.data(), w.scratch.scaled.data(), q.data());
}

// Rounding level of residuals. The level is zero near a singular position, which magnifies rounding errors.
double rounding_part(const Workspace& w) { return w.now.rows.distance < near_singular_pivot ? 0.0 : projection_floor; }

}  // namespace

void follow_constraints(const Program& p, Workspace& w, double h, VecX& move) {
    if (w.now.rows.blocks.empty()) return;
    VecX &second = w.scratch.scaled, &third = w.scratch.work;
    w.scratch.r.setZero();
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k)
            if (block.holonomic[k]) w.scratch.r[block.row + k] = -0.5 * h * h * w.now.b[block.row + k];
    }
    solve_rows(w.now.rows, w.scratch.r, w.scratch.lam_step);
    sum_rows(p, w, w.scratch.lam_step, second);
    solve_rows(w.now.rows, w.state.third_order_gap, w.scratch.lam_step);
    sum_rows(p, w, w.scratch.lam_step, third);
    third *= h * h * h;
    // The terms of the series do not decrease close to a singular position or at high speed. Skip the third order there.
    if (third.squaredNorm() < projection_parameters.falling_square * second.squaredNorm()) second += third;
    else w.state.third_order_gap.setZero();
    solve_Rt(p.mechanism, w.now.terms, second);
    move += second;
    w.now.awaits_gap = true;
}

void learn_third_order(const Program& p, Workspace& w, double h) {
    if (w.now.awaits_gap) return;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        const auto rows = Eigen::seqN(block.row, block.kept.size());
        w.state.third_order_gap(rows) += w.now.step_gap(rows) / (h * h * h);
    }
}

static double position_floor(const Program& p, const Workspace& w) { return rounding_part(w) * scene_size(p, w); }

static double velocity_floor(const Workspace& w, const VecX& v) {
    return rounding_part(w) * std::max(1.0, v.cwiseAbs().maxCoeff());
}

// Reset the multipliers of the closing move. Open contacts have rows here too, so unneeded writes are skipped.
static void reset_closing(Workspace& w) {
    if (w.now.has_closing) w.now.closing_lam.setZero();
    w.now.has_closing = false;
}

bool is_on_constraints(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    reset_closing(w);
    if (p.constraints == 0) return true;
    evaluate_residuals(p, w, t, q, v);
    if (gather_residuals(p, w) > position_floor(p, w)) return false;
    if (p.constrained_joints.empty()) evaluate_rows(p, w, t, v);  // rows of coordinates only
    else update_kinematics(p, w, t, q, v);
    return gather_rates(p, w, t, v) <= velocity_floor(w, v);
}

bool project_position(const Program& p, Workspace& w, double t, VecX& q, const VecX& v, bool is_configured,
                      bool keeps_factors) {
    reset_closing(w);
    double largest = 0.0, floor = 0.0;
    if (!w.now.rows.blocks.empty()) {
        if (!is_configured) evaluate_residuals(p, w, t, q, v);
        largest = gather_residuals(p, w);
        floor = position_floor(p, w);
        w.now.projected_gap = std::max(w.now.projected_gap, largest / std::max(floor, projection_parameters.no_floor));
    }
    const bool moves = largest > floor;
    if (moves && w.now.awaits_gap) {
        w.now.step_gap = w.scratch.r;
        w.now.awaits_gap = false;
    }
    is_configured &= !moves;  // whether the workspace is configured at q
    int count = 0;      // steps since the factors were taken
    double rate = 1.0;  // ratio of the largest residuals of the last two steps
    for (int it = 0; it < max_projection_iterations && largest > floor; ++it) {
        if (count == 0) {
            w.scratch.position_start = q;
            w.scratch.position_lam.setZero();
        }
        broyden_step(w, count);
        w.scratch.position_lam += w.scratch.position_lam_steps[count];
        w.now.closing_lam += w.scratch.position_lam_steps[count++];
        w.now.has_closing = true;
        // A step expected to end below rounding is evaluated when the end of the step is configured.
        bool reconfigures = count > 1 && largest * rate < projection_parameters.trusted_part * floor;
        double now = largest;
        if (!reconfigures) {
            move_position(p, w, q, p.constrained_dofs);  // the other dofs move no row
            evaluate_residuals(p, w, t, q, v);
            now = gather_residuals(p, w);
            reconfigures = now > floor && needs_new_factors(largest, now, floor);
        }
        is_configured = reconfigures;
        if (reconfigures) {
            move_position(p, w, q);
            configure(p, w, t, q, v);
            now = gather_residuals(p, w);
            count = 0;
        }
        if (it > projection_parameters.sure_position_steps && now > projection_parameters.stall_ratio * largest)
            break;  // converged to rounding
        rate = now / largest;
        largest = now;
    }
    if (count > 0 && static_cast<int>(p.constrained_dofs.size()) < p.mechanism.nv) move_position(p, w, q);
    // In deep trees M and its factor share storage.
    const bool serves = p.affine_rates && w.now.rows.distance >= near_singular_pivot && p.mechanism.deep_dofs.empty();
    if (!is_configured && keeps_factors && serves) place(p, w, t, q, v);
    else if (!is_configured) configure(p, w, t, q, v);
    if (moves) ++w.counters.projections;
    return moves;
}

// Set the velocity of a single dof held by a sticking element to exactly zero, as for a locked joint.
static void rest_alone(const Program& p, const Workspace& w, VecX& v) {
    for (int i : w.now.rows.blocks) {
        if (i < p.first_gap) continue;
        const Block& block = p.blocks[i];
        const size_t n = block.kept.size();
        for (size_t k = 0; k < n; ++k) {
            int entries = 0, dof = -1;
            for (size_t l = 0; l < block.support().size(); ++l)
                if (w.now.A[block.offset + l * n + k] != 0.0) { ++entries; dof = block.support()[l]; }
            if (entries == 1 && std::abs(v[dof]) <= immobile_speed) v[dof] = 0.0;
        }
    }
}

static void stop_locked(const Program& p, const Workspace& w, VecX& v) {
    for (int dof = 0; dof < p.mechanism.nv; ++dof)
        if (w.now.terms.locked[dof]) v[dof] = 0.0;  // sticking elements have exactly zero velocity
}

bool keeps_to_rows(const Program& p, Workspace& w, double t, const VecX& q, VecX& v) {
    stop_locked(p, w, v);
    if (w.now.rows.blocks.empty()) return true;
    reset_closing(w);
    const double fastest = v.cwiseAbs().maxCoeff();
    if (!p.affine_rates || fastest > projection_parameters.slow_speed) return false;
    // The check for immobility needs the independent rows, so projection decides it.
    if (fastest <= immobile_speed && (fastest > 0.0 || p.gaps.empty()) && is_immobile(p, w)) return false;
    place_bodies(p.mechanism, w.now.terms, q);
    place_rows(p, w, t, v);
    if (gather_residuals(p, w, w.now.rows.required) > projection_floor * scene_size(p, w)) return false;
    if (gather_rates(p, w, t, v, w.now.rows.required) > projection_floor) return false;
    rest_alone(p, w, v);
    return true;
}

bool project_velocity(const Program& p, Workspace& w, double t, VecX& v) {
    stop_locked(p, w, v);
    if (w.now.rows.blocks.empty()) return false;
    const double floor = velocity_floor(w, v);
    double last = gather_rates(p, w, t, v);
    w.now.projected_rate = std::max(w.now.projected_rate, last / std::max(floor, projection_parameters.no_floor));
    bool moved = false;
    for (int it = 0; it < max_projection_iterations && last > floor; ++it) {
        least_move(p, w, w.scratch.scaled);
        v += w.scratch.scaled;
        moved = true;
        configure_velocity(p, w, t, v);
        const double now = gather_rates(p, w, t, v);
        if (it > projection_parameters.sure_velocity_steps && now > projection_parameters.stall_ratio * last) break;
        last = now;
    }
    rest_alone(p, w, v);
    if (is_immobile(p, w) && v.cwiseAbs().maxCoeff() <= immobile_speed) v.setZero();
    return moved;
}

void remove_normal_velocity(const Program& p, Workspace& w, Eigen::Ref<VecX> change) {
    w.scratch.work = change;
    for (int i : w.now.rows.blocks) multiply(p.blocks[i], w.now.A, w.scratch.work, w.scratch.r);
    least_move(p, w, w.scratch.work);
    change -= w.scratch.work;
}

void remove_normal_move(const Program& p, Workspace& w, Eigen::Ref<VecX> move) {
    w.scratch.work = move;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        multiply(block, w.now.A, w.scratch.work, w.scratch.r);
        for (size_t k = 0; k < block.kept.size(); ++k)
            if (!block.holonomic[k]) w.scratch.r[block.row + k] = 0.0;
    }
    least_move(p, w, w.scratch.work);
    move -= w.scratch.work;
}

}  // namespace pn
