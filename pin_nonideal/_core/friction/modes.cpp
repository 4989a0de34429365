#include "friction/modes.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/implicit.hpp"
#include "dynamics/slip.hpp"
#include "dynamics/solution.hpp"
#include "dynamics/step_start.hpp"
#include "friction/cone_program.hpp"
#include "friction/rest_branches.hpp"
#include "friction/rest_problem.hpp"
#include "friction/rest_solver.hpp"

namespace pn {

namespace {

constexpr double slack = 1e-9;            // part of the limit by which a mode may miss its condition by rounding
constexpr double at_limit = 1e-13;        // part of the limit by which rounding may miss it
constexpr double no_acceleration = 1e-12; // part of the accelerations in play that is rounding
constexpr double limit_tolerance = 1e-12; // relative change of the limits at which the turns end
constexpr double least_limit = 1e-300;    // a limit of zero divides by this
constexpr int most_turns = 100;           // of forces and limits
constexpr double unsolved = 10.0;         // what the equation lacks leaves so much in the accelerations
constexpr double beyond = 1e-6;           // part of the load by which it is raised to see slip begin

bool contains(const std::vector<int>& list, int e) { return std::find(list.begin(), list.end(), e) != list.end(); }

// The modes of elements at rest at one state, as they are sought.
struct Search {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    const ModeQuestion& question;
    const std::vector<int>& list;  // of the elements at rest
    std::vector<int> slipping;     // those whose limits follow their load

    Search(const Program& program, Workspace& workspace, double time, const VecX& q_, const VecX& v_,
           const ModeQuestion& asked)
        : p(program), w(workspace), t(time), q(q_), v(v_), question(asked), list(asked.at_rest) {
        for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
            if (!contains(list, e) && slips(asked.modes[e]) && p.frictions[e].reaction == Reaction::total)
                slipping.push_back(e);
    }

    void apply(const std::vector<Mode>& modes, bool limits_known) {
        set_modes(p, w, modes);
        w.state.warm = limits_known;
        if (limits_known) {  // among all that these modes allow: the others are no motions from rest
            w.state.unique = Uniqueness::shown;
            w.state.growth = 1.0;
            w.state.steps_since = -1;
        }
        begin_step(p, w, t, q, v);
    }

    // Whether the motion under the modes that the question suggests keeps the conditions that they stand for, where
    // that makes it the only one: no limit depends on the load. The workspace ends evaluated there.
    bool keeps_suggestion() {
        if (p.needs_reactions || !question.breaking.empty()) return false;
        try {
            apply(question.modes, false);
        } catch (const Failure& failure) {  // what is driven does not stick
            if (failure.kind != Failure::Kind::inconsistent) throw;
            return false;
        }
        const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
        return std::all_of(list.begin(), list.end(), [&](int e) {
            if (w.state.mode[e] == sticking)
                return friction_force(p, w, e).norm() <= static_limit(p, w, e, t, q, v) * (1.0 + at_limit);
            return p.frictions[e].dim == 1 && slip_rate_along_mode(p, w, e) >= -slack * size;
        });
    }

    // What an element at rest does under a force at or below its limit; its direction of slip, that of the acceleration
    // where this tells it, stays in the workspace.
    Mode mode_of(int e, const VecX& force, const VecX& slip, double limit, bool slides, bool told) {
        const bool gives_way = contains(question.breaking, e) && force.norm() >= limit * (1.0 - slack);
        if (!gives_way && !slides) return sticking;
        const VecX direction = told ? VecX(slip.normalized()) : VecX(-force.normalized());
        Vec3 along;
        for (int k = 0; k < direction.size(); ++k) along[k] = direction[k];
        if (direction.size() > 1) w.state.slip_direction[e] = w.state.last_direction[e] = along;
        return direction.size() > 1 || along[0] > 0.0 ? slip_plus : slip_minus;
    }

    // Slip accelerations a little beyond the load at which elements give way: there they are rounding, and forces of
    // elements that share a load tell the directions in which all begin to move together only to its root.
    VecX onset_accelerations(const FrictionProblem& problem, const VecX& limits) const {
        const VecX more = (1.0 + beyond) * problem.alpha0;
        return more + problem.W * friction_program(problem.W, more, problem.dims, limits);
    }

    // Modes that the forces f of a program mean: what is below its limit sticks.
    std::vector<Mode> modes_of(const FrictionProblem& problem, const VecX& f, const VecX& limits) {
        const VecX alpha = problem.alpha0 + problem.W * f;
        const double size = problem.alpha0.cwiseAbs().maxCoeff();
        std::vector<Mode> modes = question.modes;
        VecX onset;
        for (size_t i = 0, at = 0; i < list.size(); at += problem.dims[i], ++i) {
            const VecX force = f.segment(at, problem.dims[i]), slip = alpha.segment(at, problem.dims[i]);
            const bool slides = force.norm() >= limits[i] * (1.0 - at_limit) && slip.norm() > no_acceleration * size;
            const bool slowly = problem.dims[i] > 1 && force.norm() >= limits[i] * (1.0 - slack) &&
                                slip.norm() < beyond * size;
            if (slowly && onset.size() == 0) onset = onset_accelerations(problem, limits);
            const VecX begins = slowly ? VecX(onset.segment(at, problem.dims[i])) : slip;
            const bool told = (slides || slowly) && begins.norm() > no_acceleration * size;
            modes[list[i]] = mode_of(list[i], force, begins, limits[i], slides, told);
        }
        return modes;
    }

    // The same of a solution of the equation of rest, which is as exact as what it lacks.
    std::vector<Mode> modes_of(const RestEquation& equation, const VecX& x) {
        VecX alpha, limits;
        equation.respond(x, alpha, limits);
        const double noise = no_acceleration + unsolved * equation.error(x);
        std::vector<Mode> modes = question.modes;
        for (size_t i = 0; i < list.size(); ++i) {
            const RestElement& e = equation.elements[i];
            const VecX force = x.segment(e.row, e.dim), slip = alpha.segment(e.row, e.dim);
            const bool at_its_limit = force.norm() >= limits[i] * (1.0 - at_limit) ||
                                      (force - e.rho * slip).norm() > limits[i] * (1.0 + at_limit);
            const bool accelerates = e.rho * slip.norm() > noise * equation.force_in_play(i, x, limits);
            const bool slides = !e.may_stick || (at_its_limit && accelerates);
            modes[list[i]] = mode_of(list[i], force, slip, limits[i], slides, slides);
        }
        return modes;
    }

    // Forces of all elements for the factors of their limits at hand, among all motions of a few elements; of more the
    // one in which all stick, or else any.
    bool find(const RestProblem& problem, VecX& x) {
        const RestEquation& equation = problem.equation;
        const AllMotions all = all_motions(equation);
        if (all.complete) return choose(problem, all.forces, x);
        VecX held = equation.holding_forces();
        if (!refine_rest(equation, held) || !all_stick(equation, held)) return solve_rest(equation, x);
        x = held;
        return true;
    }

    // What rested goes on resting: of several motions the one in which all that sticks in any other sticks, and more.
    bool choose(const RestProblem& problem, const std::vector<VecX>& motions, VecX& x) {
        const RestEquation& equation = problem.equation;
        proven = true;
        if (motions.empty()) return false;
        for (const VecX& one : motions) {
            const bool stickiest = std::all_of(motions.begin(), motions.end(), [&](const VecX& other) {
                return &other == &one || sticks_more(equation.sticks(one), equation.sticks(other));
            });
            if (!stickiest) continue;
            w.now.several = motions.size() > 1;
            w.now.several_element = list.front();
            x = one;
            return true;
        }
        double determinant = HUGE_VAL;
        for (const VecX& one : motions) determinant = std::min(determinant, equation.determinant(one));
        paradox(problem, determinant, motions);
    }

    // `motions`: forces of some that are possible, of which two are shown.
    [[noreturn]] void paradox(const RestProblem& problem, double determinant, const std::vector<VecX>& motions) const {
        Failure failure(Failure::Kind::paradox, t, list, determinant);
        failure.solutions = motions.empty() ? Failure::Solutions::none : Failure::Solutions::several;
        for (size_t i = 0; i < std::min<size_t>(2, motions.size()); ++i) {
            VecX alpha, limits;
            problem.equation.respond(motions[i], alpha, limits);
            failure.limits.push_back(limits.head(list.size()));
            failure.accelerations.push_back(problem.acceleration(motions[i]));
        }
        throw failure;
    }

    bool all_stick(const RestEquation& equation, const VecX& x) const {
        const std::vector<bool> sticks = equation.sticks(x);
        return std::all_of(sticks.begin(), sticks.begin() + list.size(), [](bool one) { return one; });
    }

    static bool sticks_more(const std::vector<bool>& one, const std::vector<bool>& other) {
        for (size_t i = 0; i < one.size(); ++i)
            if (other[i] && !one[i]) return false;
        return one != other;
    }

    // What begins to slip has its kinetic limit from then on. Returns whether something just did.
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

    // The motion of these modes, which have just been found together with the limits.
    void settle(const RestEquation& equation, const VecX& x, const std::vector<Mode>& modes) {
        VecX alpha, limits;
        equation.respond(x, alpha, limits);
        for (size_t i = 0; i < equation.elements.size(); ++i)
            w.state.unknown[i < list.size() ? list[i] : slipping[i - list.size()]] = limits[i];
        apply(modes, proven);
    }

    // The motion under the forces f of the elements at rest, and the limits that its loads give: the kinetic one for what
    // slips. Returns their largest relative change.
    double follow(FrictionProblem& problem, const VecX& f, const std::vector<Mode>& modes, VecX& limits) {
        VecX C = VecX::Zero(p.mechanism.nv);
        problem.add_forces(p, w, f, C);
        C = w.now.C_smooth + C;
        solve_with_laws(p, w, t, q, v, C);
        const VecX driven = problem.alpha0;
        problem.alpha0 = problem.slip_accelerations(p, w) - problem.W * f;
        for (int i = 0; i < problem.rows; ++i)
            if (problem.W(i, i) == 0.0) problem.alpha0[i] = driven[i];
        double change = 0.0;
        for (size_t i = 0; i < list.size(); ++i) {
            const Friction& friction = p.frictions[list[i]];
            double limit = static_limit(p, w, list[i], t, q, v);
            if (modes[list[i]] != sticking) limit = friction.kinetic_limit(w.now.load[list[i]], 0.0);
            change = std::max(change, std::abs(limit - limits[i]) / std::max(limit, least_limit));
            limits[i] = limit;
        }
        return change;
    }

    // Limits and forces in turn, each motion with the loads that it has; false where they do not come to rest soon.
    bool take_turns(std::vector<Mode>& modes) {
        FrictionProblem problem(p, w, list);
        problem.clean(p, w);
        problem.alpha0 = problem.slip_accelerations(p, w);
        const double noise = no_acceleration * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
        for (int i = 0; i < problem.rows; ++i)  // what the constraints hold still has no slip acceleration
            if (problem.W(i, i) == 0.0 && std::abs(problem.alpha0[i]) <= noise) problem.alpha0[i] = 0.0;
        VecX limits(list.size());
        for (size_t i = 0; i < list.size(); ++i) limits[i] = static_limit(p, w, list[i], t, q, v);
        double change = 0.0;
        for (int turn = 0; turn < most_turns; ++turn) {
            const VecX f = friction_program(problem.W, problem.alpha0, problem.dims, limits);
            const std::vector<Mode> next = modes_of(problem, f, limits);
            if (next == modes && change <= limit_tolerance) return true;
            modes = next;
            change = follow(problem, f, modes, limits);
        }
        return false;
    }

    // Elements at rest without friction; `all`: those that slip under a load of their own as well.
    void unload(bool all) {
        std::vector<Mode> modes = question.modes;
        for (int e : list) modes[e] = unloaded;
        if (all)
            for (int e : slipping) modes[e] = unloaded;
        for (int e : list) w.now.slip_force[e] = Vec3::Zero();
        apply(modes, false);
    }

    void run() {
        if (keeps_suggestion()) return;
        unload(false);
        std::vector<Mode> modes = question.modes;
        for (int e : list) modes[e] = unloaded;
        bool found = false;
        try {
            found = take_turns(modes);
        } catch (const Failure& failure) {  // loads that no motion has, under forces on the way
            if (failure.kind != Failure::Kind::paradox) throw;
        }
        if (p.needs_reactions && look_further(found, found && !released_early(modes))) return;
        if (!found) throw Failure(Failure::Kind::not_converged, t, list);
        apply(modes, false);
    }

    // Turns give what slips in one of them its kinetic limit: what holds in the end may have slipped on the way.
    bool released_early(const std::vector<Mode>& modes) const {
        return std::any_of(list.begin(), list.end(), [&](int e) {
            const Friction& friction = p.frictions[e];
            return slips(modes[e]) && friction.holding_limit(1.0) > friction.kinetic_limit(1.0, 0.0);
        });
    }

    // Where loads may leave several motions or none, or where turns found none to be trusted. Returns whether it knows
    // better.
    bool look_further(bool found, bool trusted) {
        unload(true);
        RestProblem problem(p, w, t, q, v, list, slipping);
        RestEquation& equation = problem.equation;
        if (trusted && (contraction(equation) < 1.0 || !is_searched(equation))) return false;
        VecX x = VecX::Zero(equation.n);
        bool solved = find(problem, x), one_limit = true;
        if (!solved && release(problem, equation, std::vector<Mode>(p.frictions.size(), slip_plus))) {
            one_limit = false;  // some stick by one limit and slip by another: the search had not all of these motions
            solved = find(problem, x);
        }
        while (solved && release(problem, equation, modes_of(equation, x))) solved = find(problem, x);
        if (trusted && !(proven && solved)) return false;
        if (!solved && proven && one_limit && !found)
            paradox(problem, std::min(0.0, equation.determinant_far_away()), {});
        if (solved) settle(equation, x, modes_of(equation, x));
        return solved;
    }

    bool proven = false;  // that there is no motion, or which there are
};

}  // namespace

static bool hardly_slips(const Program& p, const Workspace& w, int e, const VecX& v) {
    return slip_velocity(w.now, p.frictions[e]).norm() <= rest_speed * (1.0 + v.cwiseAbs().maxCoeff());
}

bool at_rest(const Program& p, const Workspace& w, int e, const VecX& v) {
    return w.state.mode[e] == sticking || hardly_slips(p, w, e, v);
}

void follow_velocity(const Program& p, Workspace& w, int e, ModeQuestion& question) {
    const Vec3 u = slip_velocity(w.now, p.frictions[e]);
    question.modes[e] = p.frictions[e].dim > 1 || u[0] > 0.0 ? slip_plus : slip_minus;
    if (p.frictions[e].dim > 1) w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
}

ModeQuestion question(const Program& p, Workspace& w, const VecX& v, int also) {
    ModeQuestion asked{w.state.mode, {}, {}};
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (e != also && !at_rest(p, w, e, v)) {
            follow_velocity(p, w, e, asked);
            continue;
        }
        asked.at_rest.push_back(e);
        if (e == also) asked.modes[e] = sticking;
    }
    return asked;
}

ModeQuestion first_question(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    ModeQuestion asked{w.state.mode, {}, {}};
    if (p.frictions.empty()) return asked;
    w.state.warm = false;
    update_kinematics(p, w, t, q, v);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        asked.modes[e] = sticking;
        if (hardly_slips(p, w, e, v)) asked.at_rest.push_back(e);
        else follow_velocity(p, w, e, asked);
    }
    return asked;
}

void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                   const ModeQuestion& question) {
    w.now.several = false;
    if (!question.at_rest.empty()) return Search(p, w, t, q, v, question).run();
    set_modes(p, w, question.modes);
    begin_step(p, w, t, q, v);
}

}  // namespace pn
