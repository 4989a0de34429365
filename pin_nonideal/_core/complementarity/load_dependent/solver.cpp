#include "complementarity/load_dependent/solver.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/socp_mode_newton.hpp"
#include "math/decompositions.hpp"

namespace pn {

namespace {

// Alternation of limits and forces. For given limits the forces are a convex program.
struct Alternation {
    const RestEquation& equation;
    std::vector<int> dims, rows;
    MatX W;
    VecX alpha;
    FrictionLimits limits;

    explicit Alternation(const RestEquation& e) : equation(e) {
        for (const RestElement& element : e.elements) {
            if (!element.may_stick) continue;
            dims.push_back(element.dim);
            for (int k = 0; k < element.dim; ++k) rows.push_back(element.row + k);
        }
        const int count = static_cast<int>(rows.size());
        W.resize(count, count);
        for (int i = 0; i < count; ++i)
            for (int j = 0; j < count; ++j) W(i, j) = e.W(rows[i], rows[j]);
    }

    // Given x, compute the forces of slipping elements, the limits of sticking candidates, and the accelerations left
    // for the candidates.
    void evaluate(const VecX& x, VecX& out, FrictionLimits& sticking_limits, VecX& rhs) {
        equation.respond(x, alpha, limits);
        out = x;
        sticking_limits.size.resize(dims.size());
        sticking_limits.middle = limits.middle(rows);
        int free = 0;
        for (size_t i = 0; i < equation.elements.size(); ++i) {
            const RestElement& e = equation.elements[i];
            if (e.may_stick) sticking_limits.size[free++] = limits[i];
            else out.segment(e.row, e.dim) = limits.middle.segment(e.row, e.dim) - limits[i] * e.direction;
        }
        VecX before = out;
        for (int r : rows) before[r] = 0.0;
        rhs = (alpha + equation.W * (before - x))(rows);
    }

    // Return the forces that the limits under x allow.
    VecX next(const VecX& x) {
        VecX out, rhs;
        FrictionLimits sticking_limits;
        evaluate(x, out, sticking_limits, rhs);
        out(rows) = friction_program(W, rhs, dims, sticking_limits);
        return out;
    }

    bool iterate(VecX& x) {
        double last = HUGE_VAL;
        for (int it = 0; it < load_dependent_parameters.max_alternations; ++it) {
            x = next(x);
            const double error = equation.error(x);
            if (error <= load_dependent_parameters.tolerance) return true;
            if (!(error < HUGE_VAL) || (it > 2 && error > load_dependent_parameters.max_alternation_ratio * last))
                return false;
            last = error;
        }
        return false;
    }
};

VecX newton_step(const RestEquation& equation, const VecX& x, const VecX& residual) {
    const MatX J = equation.jacobian(x);
    LU lu;
    lu.compute(J);
    if (!(lu.reciprocal_condition() > response_rank_threshold)) return least_squares(J, residual, response_rank_threshold);
    VecX step;
    lu.solve(residual, step);
    return step;
}

bool follow_path(const RestEquation& equation, VecX& x) {
    RestEquation partial_equation = equation;
    VecX alpha;
    equation.respond(x, alpha, partial_equation.fixed);
    partial_equation.frozen = 1.0;
    if (!Alternation(partial_equation).iterate(x)) return false;
    double stretch = load_dependent_parameters.first_continuation_step;
    while (partial_equation.frozen > 0.0) {
        VecX ahead = x;
        const double before = partial_equation.frozen;
        partial_equation.frozen = std::max(0.0, before - stretch);
        if (refine_rest(partial_equation, ahead)) {
            x = ahead;
            stretch *= 2.0;
            continue;
        }
        partial_equation.frozen = before;
        stretch *= 0.25;
        if (stretch < load_dependent_parameters.min_continuation_step) return false;
    }
    return true;
}

double largest_force_scale(const RestEquation& equation, const VecX& x, const FrictionLimits& limits) {
    double size = 0.0;
    for (size_t i = 0; i < equation.elements.size(); ++i) size = std::max(size, equation.force_scale(i, x, limits));
    return size;
}

// Compute the residual of rest: accelerations, scaled to forces, and excess of forces over limits. J is its derivative.
void rest_residual(const RestEquation& equation, const VecX& x, VecX& residual, MatX& J) {
    VecX alpha;
    FrictionLimits limits;
    MatX dalpha, dlimits, dmiddle;
    equation.respond(x, alpha, limits);
    equation.differentiate(x, dalpha, dlimits, dmiddle);
    const VecX from_middle = x - limits.middle;
    const MatX slope = MatX::Identity(equation.n, equation.n) - dmiddle;
    const int n = equation.n, count = static_cast<int>(equation.elements.size());
    const double no_limit = load_dependent_parameters.tolerance * largest_force_scale(equation, x, limits);
    residual.setZero(2 * n);
    J.setZero(2 * n, n);
    for (int i = 0; i < count; ++i) {
        const RestElement& e = equation.elements[i];
        const auto force = from_middle.segment(e.row, e.dim);
        if (!e.may_stick) {
            residual.segment(e.row, e.dim) = force + limits[i] * e.direction;
            J.middleRows(e.row, e.dim) = slope.middleRows(e.row, e.dim) + e.direction * dlimits.row(i);
            continue;
        }
        residual.segment(e.row, e.dim) = e.rho * alpha.segment(e.row, e.dim);
        J.middleRows(e.row, e.dim) = e.rho * dalpha.middleRows(e.row, e.dim);
        const double size = force.norm();
        if (limits[i] <= no_limit) {  // |x| has a kink at zero, x has none
            residual.segment(n + e.row, e.dim) = force;
            J.middleRows(n + e.row, e.dim) = slope.middleRows(e.row, e.dim);
        } else if (size > limits[i]) {
            residual[n + e.row] = size - limits[i];
            J.row(n + e.row) = force.transpose() / size * slope.middleRows(e.row, e.dim) - dlimits.row(i);
        }
    }
}

// Rounding error of the residual of rest.
double rest_rounding(const RestEquation& equation, const VecX& x) {
    VecX alpha;
    FrictionLimits limits;
    equation.respond(x, alpha, limits);
    return load_dependent_parameters.limit_rounding * largest_force_scale(equation, x, limits);
}

enum class Holding { holds, slips, undecided };

// Zero accelerations determine the forces unless elements are redundant. Newton's method finds these forces, and their
// limits decide. An excess over a limit that the condition of the equations may cause decides nothing. On return from an
// undecided search x is unchanged.
Holding hold_by_unique_forces(const RestEquation& equation, VecX& x) {
    const int n = equation.n;
    VecX there = x, residual, step;
    MatX J;
    LU lu;
    double condition = 0.0;  // reciprocal
    if (equation.evaluate_laws) return Holding::undecided;
    for (int it = 0; it < load_dependent_parameters.max_newton; ++it) {
        rest_residual(equation, there, residual, J);
        const double allowed = rest_rounding(equation, there);
        const bool accelerates = !(residual.head(n).cwiseAbs().maxCoeff() <= allowed);
        if (!accelerates && it > 0) {
            const double excess = residual.tail(n).cwiseAbs().maxCoeff();
            const double uncertain =
                load_dependent_parameters.forces_rounding / condition * there.cwiseAbs().maxCoeff();
            if (excess > allowed && !(excess > uncertain)) return Holding::undecided;
            x = there;
            return excess <= allowed ? Holding::holds : Holding::slips;
        }
        lu.compute(J.topRows(n));
        condition = lu.reciprocal_condition();
        if (!(condition > response_rank_threshold)) return Holding::undecided;
        lu.solve(residual.head(n), step);
        there -= step;
        if (!there.allFinite()) return Holding::undecided;
    }
    return Holding::undecided;
}

}  // namespace

// Forces of redundant elements are found by the Gauss-Newton method. If limits are linear in the forces (contacts), the
// residual is convex.
bool hold_at_rest(const RestEquation& equation, VecX& x) {
    const Holding holding = hold_by_unique_forces(equation, x);
    if (holding != Holding::undecided) return holding == Holding::holds;
    VecX residual, there, ahead;
    MatX J, J_there;
    rest_residual(equation, x, residual, J);
    for (int it = 0; it < load_dependent_parameters.max_newton; ++it) {
        if (residual.cwiseAbs().maxCoeff() <= rest_rounding(equation, x)) return true;
        const VecX step = least_squares(J, residual, response_rank_threshold);
        const double now = residual.norm();
        double length = 1.0;
        bool gains = false;
        for (int halving = 0; halving < load_dependent_parameters.max_halvings && !gains; ++halving, length *= 0.5) {
            ahead = x - length * step;
            rest_residual(equation, ahead, there, J_there);
            gains = there.norm() < (1.0 - load_dependent_parameters.min_residual_gain * length) * now;
        }
        if (!gains) return false;
        x = ahead;
        residual = there;
        J = J_there;
    }
    return false;
}

bool refine_rest(const RestEquation& equation, VecX& x) {
    double error = equation.error(x);
    for (int it = 0; it < load_dependent_parameters.max_newton && error > load_dependent_parameters.tolerance; ++it) {
        const VecX step = newton_step(equation, x, equation.residual(x));
        double length = 1.0, there = HUGE_VAL;
        VecX ahead;
        for (int halving = 0; halving < load_dependent_parameters.max_halvings; ++halving, length *= 0.5) {
            ahead = x - length * step;
            there = equation.error(ahead);
            if (there < (1.0 - load_dependent_parameters.decrease * length) * error) break;
        }
        if (!(there < error)) break;
        x = ahead;
        error = there;
    }
    return error <= load_dependent_parameters.stall_tolerance;
}

VecX onset_accelerations(const RestEquation& equation, const VecX& x) {
    Alternation turns(equation);
    VecX out, rhs;
    FrictionLimits sticking_limits;
    turns.evaluate(x, out, sticking_limits, rhs);
    VecX accelerations = turns.alpha;
    accelerations(turns.rows) = onset_accelerations(turns.W, rhs, turns.dims, sticking_limits);
    return accelerations;
}

bool solve_rest(const RestEquation& equation, VecX& x) {
    if (equation.n == 0) return true;
    const VecX guess = x;
    if (Alternation(equation).iterate(x)) return true;
    bool is_solved = refine_rest(equation, x);
    if (!is_solved) is_solved = refine_rest(equation, x = guess);
    if (!is_solved) is_solved = follow_path(equation, x = guess);
    if (!is_solved) return false;
    const VecX at_limits = Alternation(equation).next(x);  // slipping forces are exactly at their limits
    if (equation.error(at_limits) <= load_dependent_parameters.tolerance + equation.error(x)) x = at_limits;
    return true;
}

}  // namespace pn
