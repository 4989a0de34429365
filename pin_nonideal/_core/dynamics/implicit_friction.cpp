#include "dynamics/implicit_friction.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/loaded_trees.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/force_decomposition.hpp"
#include "dynamics/uniqueness.hpp"

namespace pn {

namespace {

struct Implicit : Unknowns {
    using Unknowns::Unknowns;

    bool is_due() const {
        const RunState& state = w.state;
        // the proof has already failed
        if (state.unique == Uniqueness::not_shown) return state.steps_since == undecided_steps;
        return state.steps_since >= (state.spectral_bound < implicit_friction_parameters.safe_growth
                                         ? std::max(n, implicit_friction_parameters.kept_steps)
                                         : 1);
    }

    // Check if the equation contracts for any limits, which proves that its solution y is unique. The workspace keeps
    // the motion for y.
    bool contracts(const VecX& y, bool by_trees) {
        MatX& L = w.scratch.jacobian;
        if (by_trees) bound_loads_of_trees(*this, L);
        else bound_loads(y, L);
        const double bound = spectral_bound(L);
        if (!(bound < 1.0 - uniqueness_parameters.min_determinant)) return false;
        w.state.spectral_bound = bound;
        w.state.steps_since = 0;
        w.state.unique = shares_contact_loads(p, w) ? Uniqueness::not_shown : Uniqueness::shown;
        if (by_trees) return true;
        set(y);
        motion();
        return true;
    }

    void bound_loads(const VecX& y, MatX& L) {
        ReactionEquation& arrays = w.scratch.equation;
        const FrozenZeroLoads frozen(p, w);
        equation(y, arrays);
        if (!arrays.finite()) throw Failure(Failure::Kind::not_finite, t);
        arrays.steepest(L);
    }

    // Solve for one zero-load set after the other until a solution is consistent with its own set. Other sets are searched
    // if none is found, or if a set has no solution.
    void solve_zero_load_sets(VecX& y) {
        VecX g(n);
        const VecX start = y;
        bool is_consistent = false;
        const auto failure =
            attempt({Failure::Kind::paradox}, [&] { is_consistent = alternate_zero_load_sets(y, g); });
        if (is_consistent) return;
        if (failure && failure->solutions == Failure::Solutions::several) throw *failure;
        select_among_zero_load_sets(*this, start, y,
                                   failure.value_or(Failure(Failure::Kind::not_converged, t, elements())));
        image(y, g);
    }

    // Return false if no solution is consistent with its own set. The step to another solution is damped until the error
    // decreases, because two sets could alternate forever.
    bool alternate_zero_load_sets(VecX& y, VecX& g) {
        image(y, g);
        double error = (g - y).norm();
        for (int turn = 0; turn < implicit_friction_parameters.max_zero_load_sets; ++turn) {
            const VecX from = y;
            {
                const FrozenZeroLoads frozen(p, w);
                solve_bearings(y);
            }
            if (is_motion(y)) return true;
            if (!backtrack(from, error, y, g)) break;
        }
        return false;
    }

    // Backtrack from y toward `from` until the error is smaller than before. Return false if no point has a smaller
    // error.
    bool backtrack(const VecX& from, double& error, VecX& y, VecX& g) {
        const VecX step = y - from;
        for (double part = 1.0; part >= implicit_friction_parameters.min_zero_load_step; part *= 0.5) {
            y = from + part * step;
            image(y, g);
            const double new_error = (g - y).norm();
            if (!(new_error < (1.0 - implicit_friction_parameters.min_error_gain * part) * error)) continue;
            error = new_error;
            return true;
        }
        return false;
    }

    // Assemble the equation as arrays, solve it near y, and check if the solution is unique.
    void solve_bearings(VecX& y) {
        ReactionEquation& arrays = w.scratch.equation;
        ReactionNewton& newton = w.scratch.newton;
        equation(y, arrays);
        if (!arrays.finite()) throw Failure(Failure::Kind::not_finite, t);
        VecX& before = w.scratch.before;
        before = y;
        const bool solved = newton.solve(arrays, y);
        const bool regular = solved && newton.factorize(arrays, y) > uniqueness_parameters.min_determinant;
        if (!regular || is_due()) select_solution(*this, arrays, before, y, solved);
        newton.factorize(arrays, y);
        w.scratch.factored_unknowns = n;
        double last = std::numeric_limits<double>::infinity();
        for (int it = 0; it < Unknowns::parameters.max_newton; ++it) {  // removes the rounding error of the arrays
            image(y, newton.image);
            newton.residual = newton.image - y;
            const double error = newton.residual.cwiseAbs().maxCoeff();
            if (error <= implicit_friction_parameters.tolerance * y.cwiseAbs().maxCoeff() || error >= last) return;
            last = error;
            newton.factor.solve(newton.residual, newton.step);
            y += newton.step;
        }
    }

    // Solve with user functions among the unknowns.
    void solve_laws(VecX& y) {
        VecX g(n);
        double size = 0.0, last = std::numeric_limits<double>::infinity();
        MatX& J = w.scratch.jacobian;
        for (int it = 0; it < Unknowns::parameters.max_newton; ++it) {
            image(y, g);
            const VecX residual = g - y;
            size = std::max({size, y.cwiseAbs().maxCoeff(), g.cwiseAbs().maxCoeff()});
            const double error = residual.cwiseAbs().maxCoeff();
            if (!g.allFinite()) throw Failure(Failure::Kind::not_finite, t);
            differentiate(*this, y, g, size, J);
            const bool stalls = it > 3 && error <= implicit_friction_parameters.stall_tolerance * size && error >= last;
            if (error <= implicit_friction_parameters.newton_tolerance * size || stalls) {
                search_other_solutions(*this, y, J, size);
                image(y, g);
                return;
            }
            last = error;
            const VecX step = pn::solve(MatX::Identity(n, n) - J, residual);
            // singular: limit between one solution and none
            if (!step.allFinite()) throw Failure(Failure::Kind::paradox, t, elements(), 0.0);
            y += step;
        }
        throw Failure(Failure::Kind::paradox, t, elements(), min_determinant(*this, J));
    }

    // Solve trees without rows in O(n). Return false, with the previous guess, if this does not converge.
    bool solve_trees(bool has_wrenches) {
        if (!bearings || !are_limits_of_trees(*this)) return false;
        VecX &y = w.scratch.unknown, &before = w.scratch.before;
        before = y;
        if (has_wrenches) {
            if (solve_loaded_trees(*this, y, true)) return true;
            y = before;
        }
        if (solve_loaded_trees(*this, y, false)) return true;
        y = before;
        return false;
    }

    // Iterate Newton's method from the previous solution, with the factor of an earlier evaluation of this step. Return
    // false without such a factor, or if the iteration contracts slowly.
    bool iterate_with_last_factor() {
        if (!bearings || w.scratch.factored_unknowns != n) return false;
        ReactionNewton& newton = w.scratch.newton;
        VecX& y = w.scratch.solution;
        y = w.scratch.unknown.head(n);
        newton.image.resize(n);
        double last = std::numeric_limits<double>::infinity();
        for (;;) {
            image(y, newton.image);
            newton.residual = newton.image - y;
            const double error = newton.residual.cwiseAbs().maxCoeff(), size = y.cwiseAbs().maxCoeff();
            if (error <= implicit_friction_parameters.tolerance * size) break;
            if (!(error <= implicit_friction_parameters.max_contraction * last)) {
                if (error <= implicit_friction_parameters.slow_change * size) break;
                return false;
            }
            last = error;
            newton.factor.solve(newton.residual, newton.step);
            y += newton.step;
        }
        w.scratch.unknown.head(n) = y;
        return true;
    }

    // Iterate the fixed point from the previous solution. Return false if it contracts slowly.
    bool iterate() {
        VecX &y = w.scratch.unknown, &g = w.scratch.image;
        auto yn = y.head(n);
        double last = 0.0;
        for (int it = 0; it < implicit_friction_parameters.fixed_point_limit; ++it) {
            image(y, g);
            double size = 0.0, change = 0.0;
            for (int k = 0; k < n; ++k) {
                size = std::max(size, std::abs(g[k]));
                change = std::max(change, std::abs(g[k] - y[k]));
            }
            if (!g.head(n).allFinite()) throw Failure(Failure::Kind::not_finite, t);
            yn = g.head(n);
            if (change <= implicit_friction_parameters.tolerance * size) return true;
            if (it > 1 && change > implicit_friction_parameters.max_contraction * last &&
                change > implicit_friction_parameters.slow_change * size + rounding())
                return false;
            if (it > 1 && change >= last) return true;  // rounding
            // The next change would be below rounding: compute the motion once more without a check.
            if (it > 0 && change * (change / last) <= implicit_friction_parameters.tolerance * size) {
                set(g);
                motion();
                return true;
            }
            last = change;
        }
        return false;
    }

    // Map the unknowns to their positions in the warm start, which stores all elements and laws.
    template <class Exchange>
    void exchange(const Exchange& swap) const {
        const int elements = static_cast<int>(p.frictions.size()), nv = p.mechanism.nv;
        int k = 0;
        each([&](size_t e) { swap(k++, static_cast<int>(e), 1); },
             [&](const UserLaw& law) { swap(k, elements + law.index * nv, nv); k += nv; });
    }

    void solve() {
        VecX &kept = w.state.unknown, &y = w.scratch.unknown;
        y.head(n).setZero();
        const bool is_warm = w.state.warm;
        if (is_warm)
            exchange([&](int k, int place, int count) { y.segment(k, count) = kept.segment(place, count); });
        w.state.warm = false;  // the state after a failure is not an initial guess
        const bool by_trees = w.state.has_wrenches = solve_trees(is_warm && w.state.has_wrenches);
        const bool by_factor = !by_trees && is_warm && iterate_with_last_factor();
        if (!(by_trees || by_factor || iterate()) || (bearings && is_due() && !contracts(y, by_trees))) {
            VecX& solution = w.scratch.solution;
            solution = y.head(n);
            if (bearings && shares_contact_loads(p, w)) solve_zero_load_sets(solution);
            else if (bearings) solve_bearings(solution);
            else solve_laws(solution);
            y.head(n) = solution;
        } else if (!bearings) {
            w.state.unique = Uniqueness::not_shown;
        }
        exchange([&](int k, int place, int count) { kept.segment(place, count) = y.segment(k, count); });
    }
};

}  // namespace

// Compute loads from the ideal motion, as in Example (c) of the paper. The laws with these loads are then known.
static void ideal_loads(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    bool has_ideal_reaction = !p.elements_of_ideal_loads.empty();
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) { has_ideal_reaction |= law.reaction == Reaction::ideal; });
    if (!has_ideal_reaction) return;
    const IdealMotion motion(p, w);
    for (int e : p.elements_of_ideal_loads) update_limit(p, w, e, t, q, v);
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) {
        if (law.reaction == Reaction::ideal) w.now.base_C += user_law_force(p, law, w, t, q, v);
    });
}

void find_known_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    w.now.C_smooth.setZero();
    add_smooth_forces(p, w, t, q, v, w.now.C_smooth);
    for (int e : p.elements_without_reaction) update_limit(p, w, e, t, q, v);
    add_slip_forces(p, w, false, w.now.C_smooth);
}

void solve_with_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const VecX& known) {
    const bool act = laws_act(p, w);
    if (!p.needs_reactions || !act) {
        w.now.C = known;
        solve_motion(p, w, true);
        if (!act) w.state.unique = Uniqueness::shown;
        return;
    }
    w.now.base_C = known;  // C that stays constant during the iteration
    ideal_loads(p, w, t, q, v);
    Implicit implicit{p, w, t, q, v};
    if (implicit.n == 0) implicit.motion();
    else implicit.solve();
    if (implicit.n == 0) w.state.unique = Uniqueness::shown;
    w.state.warm = true;
}

void solve_with_step_friction(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    Unknowns unknowns{p, w, t, q, v};
    for (int e : unknowns.elements()) {
        const Block& block = p.blocks[p.frictions[e].block];
        w.now.limit[e] = w.state.percussion.segment(block.row, static_cast<Eigen::Index>(block.kept.size())).norm();
    }
    unknowns.motion();
    w.state.unique = Uniqueness::not_shown;
}

}  // namespace pn
