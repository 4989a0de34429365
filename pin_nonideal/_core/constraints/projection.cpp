#include "constraints/projection.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/solution.hpp"
#include "friction/modes.hpp"
#include "tree/factor.hpp"
#include "tree/liegroup.hpp"

namespace pn {

namespace {

// x := R^-T B^T (B B^T)^-1 r, the least move in the metric of M that changes A x by r.
void least_move(const Program& p, Workspace& w, VecX& x) {
    solve_rows(p.layout, w.now.rows, w.scratch.r, w.now.lam);
    x.setZero();
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.B, w.now.lam, x);
    solve_Rt(p.mechanism, w.now.terms, x);
}

// Takes a residual or rate of each kept row into r, negative; returns the largest of the rows in use.
template <class Value>
double gather(const Program& p, Workspace& w, Value value) {
    double largest = 0.0;
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k) {
            const double x = value(i, static_cast<int>(k));
            w.scratch.r[block.row + k] = -x;
            if (w.now.rows.active[block.row + k]) largest = std::max(largest, std::abs(x));
        }
    }
    return largest;
}

double gather_gaps(const Program& p, Workspace& w) {
    return gather(p, w, [&](int i, int k) { return w.now.values[i].residual[p.blocks[i].kept[k]]; });
}

// A v + phi_t by the rows in the workspace, which needs no look at the motion; a user's rate is his own function.
double gather_rates(const Program& p, Workspace& w, double t, const VecX& v) {
    const State state{p.mechanism, w.now.terms, t, w.now.terms.q, v};
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        if (std::holds_alternative<UserRows>(block.kind)) evaluate(block.kind, state, Part::motion, w.now.values[i]);
        else multiply(block, w.now.A, v, w.scratch.miss);
    }
    return gather(p, w, [&](int i, int k) {
        const Block& block = p.blocks[i];
        const RowValues& values = w.now.values[i];
        if (std::holds_alternative<UserRows>(block.kind)) return values.rate[block.kept[k]];
        return w.scratch.miss[block.row + k] + values.phi_t[block.kept[k]];
    });
}

// Iterations left when each takes as much as the last one did; factors of the new place cost less than three of them.
double left_at_this_rate(double before, double now, double floor) {
    return now < before ? std::log(now / std::max(floor, 1e-16)) / std::log(before / now) : HUGE_VAL;
}

// Product of multipliers of rows of unit length.
double product(const Workspace& w, const VecX& x, const VecX& y) {
    double sum = 0.0;
    for (int k = 0; k < x.size(); ++k)
        if (w.now.rows.active[k]) sum += x[k] * y[k] / (w.now.rows.scale[k] * w.now.rows.scale[k]);
    return sum;
}

// Next step of the multipliers, s := (B B^T)^-1 r with Broyden's corrections: the factors are those of the place where
// the move started, and each step has shown what they miss. [Kelley, Solving Nonlinear Equations with Newton's Method,
// 2003, sec. 4.3.]
void broyden_step(const Program& p, Workspace& w, int count) {
    VecX& step = w.scratch.shift_steps[count];
    solve_rows(p.layout, w.now.rows, w.scratch.r, step);
    for (int j = 0; j < count; ++j) {
        const VecX& known = w.scratch.shift_steps[j];
        const double part = product(w, known, step) / product(w, known, known);
        if (!(std::abs(part) < broyden_limit)) return;  // rounding, or far from where the factors serve
        if (j + 1 < count) step += part * w.scratch.shift_steps[j + 1];
        else step /= 1.0 - part;
    }
}

// q := shift_start moved by R^-T B^T shift, on the given dofs.
template <class... Dofs>
void shift_position(const Program& p, Workspace& w, VecX& q, const Dofs&... dofs) {
    w.scratch.scaled.setZero();
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.B, w.scratch.shift, w.scratch.scaled);
    solve_Rt(p.mechanism, w.now.terms, dofs..., w.scratch.scaled);
    retract(p.mechanism, w.scratch.shift_start.data(), w.scratch.scaled.data(), q.data());
}

// What is rounding: near a singular position it would come back magnified, there every bit counts.
double rounding_part(const Workspace& w) { return w.now.rows.distance < near_singular ? 0.0 : projection_floor; }

}  // namespace

double scene_size(const Program& p, const Workspace& w) {
    double square = 1.0;
    for (int i : p.touched_joints) square = std::max(square, (w.now.terms.body[i].ref + w.now.terms.body[i].p).squaredNorm());
    return std::sqrt(square);
}

// Size of a row of A, at least 1: a row that was scaled up leaves a gap as much larger.
static double row_size(const Workspace& w, const Block& block, int row) {
    double size = 1.0;
    const size_t n = block.kept.size();
    for (size_t k = 0; k < n; ++k) {
        if (block.kept[k] != row) continue;
        for (size_t l = 0; l < block.support.size(); ++l)
            size = std::max(size, std::abs(w.now.A[block.offset + l * n + k]));
    }
    return size;
}

void require_closed(const Program& p, const Workspace& w, double t) {
    const double allowed = open_gap * scene_size(p, w);
    double largest = 0.0;
    int worst = -1;
    for (int i = 0; i < p.constraints; ++i)
        for (int k = 0; k < w.now.values[i].rows; ++k) {
            const double gap = std::abs(w.now.values[i].residual[k]);
            if (gap <= allowed || gap <= allowed * row_size(w, p.blocks[i], k) || gap < largest) continue;
            largest = gap;
            worst = i;
        }
    if (worst >= 0) throw Failure(Failure::Kind::closure, t, {worst}, largest);
}

void follow_constraints(const Program& p, Workspace& w, double h, VecX& move) {
    if (w.now.rows.blocks.empty()) return;
    w.scratch.r.setZero();
    for (int i : w.now.rows.blocks) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k)
            if (block.holonomic[k]) w.scratch.r[block.row + k] = -0.5 * h * h * w.now.b[block.row + k];
    }
    solve_rows(p.layout, w.now.rows, w.scratch.r, w.scratch.shift);
    // Terms of a series that do not fall predict nothing: close to a singular position, at great speed.
    const double cube = h * h * h, second = product(w, w.scratch.shift, w.scratch.shift);
    if (cube * cube * product(w, w.state.shift_third, w.state.shift_third) < falling_square * second) w.scratch.shift += cube * w.state.shift_third;
    else w.state.shift_third.setZero();
    w.scratch.scaled.setZero();
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.B, w.scratch.shift, w.scratch.scaled);
    solve_Rt(p.mechanism, w.now.terms, w.scratch.scaled);
    move += w.scratch.scaled;
}

void learn_third_order(Workspace& w, double h) { w.state.shift_third += w.scratch.shift_sum / (h * h * h); }

bool project_position(const Program& p, Workspace& w, double t, VecX& q, const VecX& v) {
    w.scratch.shift_sum.setZero();
    double gap = 0.0, floor = 0.0;
    if (!w.now.rows.blocks.empty()) {
        evaluate_residuals(p, w, t, q, v);
        gap = gather_gaps(p, w);
        floor = rounding_part(w) * scene_size(p, w);
    }
    const bool moves = gap > floor;
    bool configured = false;
    int count = 0;      // steps since the factors were taken
    double rate = 1.0;  // of the gap, by the last of them
    for (int it = 0; it < projection_limit && gap > floor; ++it) {
        if (count == 0) {
            w.scratch.shift_start = q;
            w.scratch.shift.setZero();
        }
        broyden_step(p, w, count);
        w.scratch.shift += w.scratch.shift_steps[count];
        w.scratch.shift_sum += w.scratch.shift_steps[count++];
        // A gap that goes on as it did, and so ends below rounding, is looked at where the step's end is configured.
        configured = count > 1 && gap * rate < trusted_part * floor;
        double now = gap;
        if (!configured) {
            shift_position(p, w, q, p.touched_dofs);  // the others move no gap
            evaluate_residuals(p, w, t, q, v);
            now = gather_gaps(p, w);
            configured = now > floor && left_at_this_rate(gap, now, floor) > 3.0;
        }
        if (configured) {
            shift_position(p, w, q);
            configure(p, w, t, q, v);
            now = gather_gaps(p, w);
            count = 0;
        }
        if (it > 3 && now > 0.5 * gap) break;  // as good as rounding allows
        rate = now / gap;
        gap = now;
    }
    if (count > 0 && static_cast<int>(p.touched_dofs.size()) < p.mechanism.nv) shift_position(p, w, q);
    if (!configured) configure(p, w, t, q, v);
    if (moves) ++w.counters.projections;
    return moves;
}

// What sticks along a single dof has exactly no velocity there, like a joint that is locked, and not one of rounding.
static void rest_alone(const Program& p, const Workspace& w, VecX& v) {
    for (int i : w.now.rows.blocks) {
        if (i < p.constraints) continue;
        const Block& block = p.blocks[i];
        const size_t n = block.kept.size();
        for (size_t k = 0; k < n; ++k) {
            int entries = 0, dof = -1;
            for (size_t l = 0; l < block.support.size(); ++l)
                if (w.now.A[block.offset + l * n + k] != 0.0) { ++entries; dof = block.support[l]; }
            if (entries == 1 && std::abs(v[dof]) <= immobile_speed) v[dof] = 0.0;
        }
    }
}

bool project_velocity(const Program& p, Workspace& w, double t, VecX& v) {
    for (int dof = 0; dof < p.mechanism.nv; ++dof)
        if (w.now.terms.locked[dof]) v[dof] = 0.0;  // what sticks has exactly no velocity
    if (w.now.rows.blocks.empty()) return false;
    const double floor = rounding_part(w) * std::max(1.0, v.cwiseAbs().maxCoeff());
    double last = gather_rates(p, w, t, v);
    bool moved = false;
    for (int it = 0; it < projection_limit && last > floor; ++it) {
        least_move(p, w, w.scratch.scaled);
        v += w.scratch.scaled;
        moved = true;
        configure_velocity(p, w, t, v);
        const double now = gather_rates(p, w, t, v);
        if (it > 1 && now > 0.5 * last) break;
        last = now;
    }
    rest_alone(p, w, v);
    if (is_immobile(p, w) && v.cwiseAbs().maxCoeff() <= immobile_speed) v.setZero();
    return moved;
}

bool project(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    const bool moved = project_position(p, w, t, q, v);
    return project_velocity(p, w, t, v) || moved;
}

void remove_normal_part(const Program& p, Workspace& w, Eigen::Ref<VecX> motion) {
    w.scratch.work = motion;
    for (int i : w.now.rows.blocks) multiply(p.blocks[i], w.now.A, w.scratch.work, w.scratch.r);
    least_move(p, w, w.scratch.work);
    motion -= w.scratch.work;
}

void project_anew(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    set_modes(p, w, std::vector<signed char>(p.frictions.size(), 1));
    configure(p, w, t, q, v);
    if (w.now.rows.blocks.empty()) return;
    if (w.now.rows.orthogonal) {  // their Cholesky factor does not show that they are independent
        decide_rows(p.layout, p.blocks, w.now.B, w.now.rows);
        factor_rows(p.layout, p.blocks, w.now.B, w.now.rows);
    }
    project(p, w, t, q, v);
}

Closure close(const Program& p, Workspace& w, double t, VecX& q, VecX& v, double far) {
    Closure found;
    update_kinematics(p, w, t, q, v);
    violations(p, w, found.before, found.rate);
    found.after = found.before;
    if (!(found.before <= far)) return found;
    project_anew(p, w, t, q, v);
    update_kinematics(p, w, t, q, v);
    violations(p, w, found.after, found.rate);
    return found;
}

}  // namespace pn
