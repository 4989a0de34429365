#include "friction/stick_slip.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/evaluation.hpp"
#include "dynamics/implicit_friction.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/step_start.hpp"
#include "complementarity/socp_mode_newton.hpp"
#include "friction/mode_enumeration.hpp"
#include "complementarity/load_dependent/enumeration.hpp"
#include "friction/load_dependent_problem.hpp"
#include "friction/rest_motions.hpp"
#include "complementarity/load_dependent/solver.hpp"
#include "math/anderson.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

bool contains(const std::vector<int>& list, int e) { return std::find(list.begin(), list.end(), e) != list.end(); }

// Search of the modes of elements at rest at one state.
struct Search {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    const ModeQuery& query;
    const std::vector<int>& list;  // elements at rest
    std::vector<int> slipping;     // slipping elements with load-dependent limits
    RestMotions motions;           // motions of the elements with load-dependent limits
    bool loads_are_feasible = true;           // the motion of the iteration has no contact in tension

    Search(const Program& program, Workspace& workspace, double time, const VecX& q_, const VecX& v_,
           const ModeQuery& mode_query)
        : p(program), w(workspace), t(time), q(q_), v(v_), query(mode_query), list(mode_query.at_rest),
          motions(program, workspace, time, list) {
        for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
            if (!contains(list, e) && slips(mode_query.modes[e]) && p.frictions[e].reaction == Reaction::total)
                slipping.push_back(e);
    }

    void apply(const std::vector<Mode>& modes, bool limits_known) {
        set_modes(p, w, modes);
        w.state.warm = limits_known;
        if (limits_known) {  // other solutions of these modes do not start from rest
            w.state.unique = Uniqueness::shown;
            w.state.spectral_bound = 1.0;
            w.state.steps_since = -1;
        }
        begin_step(p, w, t, q, v);
    }

    // Set the kinetic limit of elements at slip onset. Return true if any limit changed.
    bool release(const RestProblem& problem, RestEquation& equation, const std::vector<Mode>& modes) {
        bool any = false;
        for (size_t i = 0; i < list.size(); ++i) {
            RestElement& e = equation.elements[i];
            if (!e.may_stick || !slips(modes[list[i]]) || e.factor == problem.sliding_factor(i)) continue;
            e.factor = problem.sliding_factor(i);
            any = true;
        }
        return any;
    }

    // Apply the modes, together with the limits of the same solution as warm start.
    void settle(const RestEquation& equation, const VecX& x, const std::vector<Mode>& modes) {
        VecX alpha;
        FrictionLimits limits;
        equation.respond(x, alpha, limits);
        for (size_t i = 0; i < equation.elements.size(); ++i) {
            const int e = i < list.size() ? list[i] : slipping[i - list.size()];
            const double middle = limits.middle[equation.elements[i].row];
            w.state.unknown[e] = limits[i] - (slips(modes[e]) ? modes[e] * middle : 0.0);
        }
        w.state.has_wrenches = false;
        apply(modes, motions.are_complete());
    }

    // Compute the motion under the forces f of the elements at rest, and update the limits from its loads. Slipping
    // elements get their kinetic limit. Return the largest relative change of the limits.
    double follow(FrictionProblem& problem, const VecX& f, const std::vector<Mode>& modes, FrictionLimits& limits) {
        VecX C = VecX::Zero(p.mechanism.nv);
        problem.add_forces(p, w, f, C);
        C = w.now.C_smooth + C;
        solve_with_laws(p, w, t, q, v, C);
        const VecX driven = problem.alpha0;
        problem.alpha0 = problem.slip_accelerations(p, w) - problem.W * f;
        for (int i = 0; i < problem.rows; ++i)
            if (problem.W(i, i) == 0.0) problem.alpha0[i] = driven[i];
        const double min_limit = stick_slip_parameters.limit_force_rounding / stick_slip_parameters.limit_tolerance *
                                 w.now.F.cwiseAbs().maxCoeff();
        double change = 0.0;
        for (size_t i = 0, row = 0; i < list.size(); row += problem.dims[i], ++i) {
            const Friction& friction = p.frictions[list[i]];
            SlipLimits now = static_limits(p, w, list[i], t, q, v);
            if (modes[list[i]] != sticking) now = w.now.load[list[i]] * friction.speed_factor(0.0);
            const double limit_change =
                std::max(std::abs(now.reach() - limits[i]), std::abs(now.middle() - limits.middle[row]));
            change = std::max(change, limit_change / std::max({now.reach(), min_limit, min_scale}));
            limits.size[i] = now.reach();
            limits.middle[row] = now.middle();
        }
        return change;
    }

    // Alternate between forces and load-dependent limits. Return false if the iteration does not converge.
    bool alternate(std::vector<Mode>& modes) {
        FrictionProblem problem(p, w, list);
        problem.clean(p, w);
        problem.alpha0 = problem.slip_accelerations(p, w);
        problem.unload_held(p, w);
        FrictionLimits limits(static_cast<int>(list.size()), problem.rows);
        for (size_t i = 0, row = 0; i < list.size(); row += problem.dims[i], ++i) {
            const SlipLimits now = static_limits(p, w, list[i], t, q, v);
            limits.size[i] = now.reach();
            limits.middle[row] = now.middle();
        }
        double change = 0.0;
        VecX f;
        const bool are_unique = problem.has_unique_forces();
        for (int turn = 0; turn < stick_slip_parameters.max_limit_iterations; ++turn) {
            // Forces that are not unique would depend on the initial ones.
            const VecX last = f;
            f = friction_program(problem.W, problem.alpha0, problem.dims, limits, turn > 0 && are_unique ? &last : nullptr);
            const std::vector<Mode> next = modes_of(w, query, problem, f, limits);
            if (next == modes && change <= stick_slip_parameters.limit_tolerance) return true;
            modes = next;
            change = follow(problem, f, modes, limits);
        }
        return false;
    }

    // Forces of the elements at rest in the nearby motion.
    VecX nearby_forces(const RestEquation& equation) const {
        VecX x = VecX::Zero(equation.n);
        for (size_t i = 0; i < list.size(); ++i)
            for (int k = 0; k < equation.elements[i].dim; ++k)
                x[equation.elements[i].row + k] = query.nearby_friction[list[i]][k];
        return x;
    }

    // Remove the friction of elements at rest. `all`: also that of slipping elements with load-dependent limits.
    void unload(bool all) {
        std::vector<Mode> modes = query.modes;
        for (int e : list) modes[e] = unloaded;
        if (all)
            for (int e : slipping) modes[e] = unloaded;
        for (int e : list) w.now.slip_force.change(e) = Vec3::Zero();
        apply(modes, false);
    }

    // Check if an element that begins to slip does so along the direction of its mode.
    bool slips_along_mode(int e, double noise) const {
        if (!slips(w.state.mode[e])) return true;
        const Friction& friction = p.frictions[e];
        const Vec3 rate = slip_acceleration(p, w, friction);
        const double size = rate.norm(), along = slip_rate_along_mode(p, w, e);
        return size <= noise || along >= (1.0 - stick_slip_parameters.max_direction_deviation) * size;
    }

    // Solve for the slip directions of elements that begin to slip in several directions, from nearby directions. Each
    // direction equals the direction of the slip acceleration under the friction along all directions. An acceleration
    // of zero, at an onset exactly at the limits, leaves the direction unchanged. Return false if the iteration does
    // not converge.
    bool settle_directions() {
        std::vector<int> turning;
        for (int e : list)
            if (slips(w.state.mode[e]) && p.frictions[e].dim > 1) turning.push_back(e);
        AndersonAcceleration acceleration;
        const double min_onset = slip_onset_parameters.max_acceleration *
                                 (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
        VecX x(3 * turning.size()), g(x.size());
        for (int turn = 0; turn < stick_slip_parameters.max_turns; ++turn) {
            double deviation = 0.0;
            for (size_t i = 0; i < turning.size(); ++i) {
                const Vec3 rate = slip_acceleration(p, w, p.frictions[turning[i]]), now = w.state.last_direction[turning[i]];
                const Vec3 next = rate.norm() > min_onset ? rate.normalized() : now;
                deviation = std::max(deviation, (next - now).norm());
                x.segment<3>(3 * i) = now.eigen();
                g.segment<3>(3 * i) = next.eigen();
            }
            if (deviation <= stick_slip_parameters.settled_direction) return true;
            x = acceleration.next(x, g);
            for (size_t i = 0; i < turning.size(); ++i)
                w.state.slip_direction[turning[i]] = w.state.last_direction[turning[i]] =
                    Vec3(x.segment<3>(3 * i)).normalized();
            solve_dynamics(p, w, t, v);
        }
        return false;
    }

    // Try the modes of a nearby motion, which are right if their motion satisfies all laws. Few elements are searched for
    // other motions instead.
    bool keeps_nearby_modes() {
        if (static_cast<int>(list.size()) <= max_searched_forces || query.nearby_modes.empty()) return false;
        std::vector<Mode> modes = query.modes;
        for (int e : list) modes[e] = query.nearby_modes[e];
        if (std::any_of(list.begin(), list.end(), [&](int e) { return modes[e] == unloaded; })) return false;
        const std::vector<Vec3> directions = w.state.slip_direction, last_directions = w.state.last_direction;
        for (int e : list)
            if (slips(modes[e]) && p.frictions[e].dim > 1)
                w.state.slip_direction[e] = w.state.last_direction[e] = query.nearby_directions[e];
        const auto failure = attempt({Failure::Kind::paradox, Failure::Kind::not_converged, Failure::Kind::inconsistent},
                                     [&] { apply(modes, false); });
        if (!failure && satisfies_laws() && settle_directions() && satisfies_laws()) return true;
        w.state.slip_direction = directions;
        w.state.last_direction = last_directions;
        return false;
    }

    // Check if the forces of the current motion hold the sticking elements and oppose slip onsets.
    bool satisfies_laws() {
        const double noise = relative_acceleration_rounding * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
        return shares_hold(p, w, list, t, q, v) &&
               std::all_of(list.begin(), list.end(), [&](int e) { return slips_along_mode(e, noise); });
    }

    void run() {
        if (query.is_solved_jointly) {
            apply(query.modes, false);
            w.now.several = query.several;
            w.now.several_element = query.several_element < 0 ? list.front() : query.several_element;
            return;
        }
        if (keeps_nearby_modes()) return;
        std::vector<Mode> modes = query.modes;
        for (int e : list) modes[e] = unloaded;
        bool found = false;
        attempt({Failure::Kind::paradox}, [&] {  // elements at rest do not have their final forces here
            unload(false);
            found = alternate(modes);
            loads_are_feasible = !found || reactions(p, w).loads_are_feasible;
        });
        if (p.needs_reactions && search_further(found, modes)) return;
        if (found) return apply(modes, false);
        if (!enumerate_modes(p, w, t, q, v, query)) throw Failure(Failure::Kind::not_converged, t, list);
    }

    // Check if the iteration may have lowered a limit too early: an element that slips in one iterate gets its kinetic
    // limit.
    bool is_released_early(const std::vector<Mode>& modes) const {
        return std::any_of(list.begin(), list.end(), [&](int e) {
            const Friction& friction = p.frictions[e];
            return slips(modes[e]) && friction.holding_limit(1.0) > friction.kinetic_limit(1.0, 0.0);
        });
    }

    // Search further if loads may allow several motions or none, or if the iteration gave no reliable motion. Return true
    // if the search found the motion.
    bool search_further(bool found, const std::vector<Mode>& turned) {
        const bool is_reliable = found && loads_are_feasible && !is_released_early(turned);
        const bool slid = !found || std::any_of(list.begin(), list.end(), [&](int e) { return turned[e] != sticking; });
        unload(true);
        RestProblem problem(p, w, t, q, v, list, slipping);
        RestEquation& equation = problem.equation;
        if (is_reliable && contraction_bound(equation) < 1.0) return false;
        VecX x;
        // A complete search includes this motion. If all elements hold, no other motion has more sticking elements.
        const bool all_known = is_searched(equation) && !problem.has_zero_load_sets();
        if (slid && !all_known && equation.is_load_dependent()) {
            if (motions.hold(problem, x) && !any_breaks(query, equation, x)) {
                w.now.several = is_reliable;
                w.now.several_element = list.front();
                std::vector<Mode> modes = query.modes;
                for (int e : list) modes[e] = sticking;
                settle(equation, x, modes);
                return true;
            }
            if (problem.has_zero_load_sets()) problem.freeze_zero_loads(VecX::Zero(equation.n));
        }
        if (is_reliable && !is_searched(equation)) return false;
        x = VecX::Zero(equation.n);
        bool solved = motions.find(problem, x), one_limit = true;
        if (!solved && !query.nearby_friction.empty()) {
            x = nearby_forces(equation);
            solved = motions.refine(problem, x);
        }
        if (!solved && release(problem, equation, std::vector<Mode>(p.frictions.size(), slip_plus))) {
            one_limit = false;  // static and kinetic limits differ: the search missed such motions
            solved = motions.find(problem, x);
        }
        while (solved && release(problem, equation, modes_of(w, query, equation, x)))
            solved = motions.find(problem, x);
        if (is_reliable && !(motions.are_complete() && solved)) return false;
        if (!solved && motions.are_complete() && one_limit && !found)
            motions.paradox(problem, std::min(0.0, equation.determinant_far_away()), {});
        if (solved) settle(equation, x, modes_of(w, query, equation, x));
        return solved;
    }
};

}  // namespace

void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                   const ModeQuery& query) {
    w.now.several = false;
    if (!query.at_rest.empty()) return Search(p, w, t, q, v, query).run();
    set_modes(p, w, query.modes);
    begin_step(p, w, t, q, v);
}

}  // namespace pn
