#include "friction/modes.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/implicit.hpp"
#include "dynamics/slip.hpp"
#include "dynamics/solution.hpp"
#include "dynamics/step_start.hpp"
#include "friction/cone_program.hpp"
#include "friction/problem.hpp"

namespace pn {

namespace {

constexpr int breaking_passes = 20;       // after these, what reached its limit may stick again
constexpr int outer_limit = 100;          // of limits that depend on the load
constexpr int outer_patience = 6;         // after these, modes that stay the same are tried as they are
constexpr int most_enumerated = 8;        // elements whose combinations of modes are all tried at last
constexpr double limit_tolerance = 1e-12; // relative change of the limits at which the outer iteration ends
constexpr double slack = 1e-9;            // part of the limit by which a mode may miss its condition by rounding
constexpr double at_limit = 1e-13;        // part of the limit by which a program's force may miss it
constexpr double no_acceleration = 1e-12; // part of the accelerations in play that is rounding
constexpr double least_limit = 1e-300;    // a limit of zero divides by this

bool contains(const std::vector<int>& list, int e) { return std::find(list.begin(), list.end(), e) != list.end(); }

// The modes of elements at rest at one state, as they are sought.
struct Search {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    const ModeQuestion& question;
    const std::vector<int>& list;  // of the elements at rest
    double determinant = HUGE_VAL;  // least of the modes in which the reactions have no solution or several

    bool breaks(size_t i, bool released) const { return released && contains(question.breaking, list[i]); }

    void apply(const std::vector<Mode>& modes) {
        std::vector<Mode> all = question.modes;
        for (size_t i = 0; i < list.size(); ++i) all[list[i]] = modes[i];
        set_modes(p, w, all);
        w.state.warm = false;
        begin_step(p, w, t, q, v);
    }

    void clear_forces() {
        for (int e : list) w.now.slip_force[e] = Vec3::Zero();
        w.now.reactions.current = false;
    }

    // Whether the motion under these modes, loads and all, keeps the conditions that they stand for; the workspace
    // ends evaluated there.
    bool hold(const FrictionProblem& problem, const std::vector<Mode>& modes, bool released) {
        try {
            clear_forces();
            apply(modes);
        } catch (const Failure& failure) {
            if (failure.kind != Failure::Kind::paradox) throw;
            determinant = std::min(determinant, failure.value);
            return false;
        }
        const VecX alpha = problem.slip_accelerations(p, w);
        const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
        for (size_t i = 0, at = 0; i < list.size(); at += problem.dims[i], ++i) {
            if (modes[i] == sticking) {
                const double limit = static_limit(p, w, list[i], t, q, v);
                const double force = friction_force(p, w, list[i]).norm();
                if (force > limit * (1.0 + slack)) return false;
                if (breaks(i, released) && force >= limit * (1.0 - slack)) return false;
            } else if (problem.dims[i] > 1 || modes[i] * alpha[at] < -slack * size) {
                return false;
            }
        }
        return true;
    }

    // All combinations of modes in turn, those that stick first; true at the first that holds.
    bool enumerate(const FrictionProblem& problem, bool released) {
        const int n = static_cast<int>(list.size());
        if (n > most_enumerated || problem.rows != n) return false;
        int combinations = 1;
        for (int i = 0; i < n; ++i) combinations *= 3;
        constexpr Mode in_turn[] = {sticking, slip_plus, slip_minus};
        std::vector<Mode> modes(n);
        for (int combination = 0; combination < combinations; ++combination) {
            for (int i = 0, rest = combination; i < n; ++i, rest /= 3)
                modes[i] = in_turn[rest % 3];
            if (hold(problem, modes, released)) return true;
        }
        return false;
    }

    // Modes that the forces f of the program mean: what is below its limit sticks.
    std::vector<Mode> modes_of(const FrictionProblem& problem, const VecX& f, const VecX& limits, bool released) {
        const VecX alpha = problem.alpha0 + problem.W * f;
        const double size = problem.alpha0.cwiseAbs().maxCoeff() + least_limit;
        std::vector<Mode> modes(list.size(), sticking);
        for (size_t i = 0, at = 0; i < list.size(); at += problem.dims[i], ++i) {
            const int dim = problem.dims[i];
            const auto force = f.segment(at, dim), slip = alpha.segment(at, dim);
            const bool gives_way = breaks(i, released) && force.norm() >= limits[i] * (1.0 - slack);
            const bool slides = force.norm() >= limits[i] * (1.0 - at_limit) && slip.norm() > no_acceleration * size;
            if (!gives_way && !slides) continue;
            const VecX direction = slides ? VecX(slip.normalized()) : VecX(-force.normalized());
            modes[i] = dim > 1 || direction[0] > 0.0 ? slip_plus : slip_minus;
            if (dim == 1) continue;
            Vec3& along = w.state.slip_direction[list[i]];
            along = Vec3::Zero();
            for (int k = 0; k < dim; ++k) along[k] = direction[k];
            w.state.last_direction[list[i]] = along;
        }
        return modes;
    }

    // The motion under the forces f of the elements, and the limits that its loads give: the kinetic one for what
    // slips. Returns their largest relative change.
    double follow(FrictionProblem& problem, const VecX& f, const std::vector<Mode>& modes, VecX& limits) {
        VecX C = VecX::Zero(p.mechanism.nv);
        problem.add_forces(p, w, f, C);
        C = w.now.C_smooth + C;
        solve_with_laws(p, w, t, w.now.terms.q, v, C);
        const VecX driven = problem.alpha0;
        problem.alpha0 = problem.slip_accelerations(p, w) - problem.W * f;
        for (int i = 0; i < problem.rows; ++i)
            if (problem.W(i, i) == 0.0) problem.alpha0[i] = driven[i];
        double change = 0.0;
        for (size_t i = 0; i < list.size(); ++i) {
            const Friction& friction = p.frictions[list[i]];
            double limit = static_limit(p, w, list[i], t, q, v);
            if (modes[i] != sticking) limit = friction.kinetic_limit(w.now.load[list[i]], 0.0);
            change = std::max(change, std::abs(limit - limits[i]) / std::max(limit, least_limit));
            limits[i] = limit;
        }
        return change;
    }

    // The problem without any friction of the elements, and first limits from the load there.
    FrictionProblem pose(const std::vector<Mode>& unloaded_modes, VecX& limits) {
        clear_forces();
        apply(unloaded_modes);
        FrictionProblem problem(p, w, list);
        problem.clean(p, w);
        problem.alpha0 = problem.slip_accelerations(p, w);
        for (size_t i = 0; i < list.size(); ++i) limits[i] = static_limit(p, w, list[i], t, q, v);
        const double noise = no_acceleration * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
        for (int i = 0; i < problem.rows; ++i)  // what the constraints hold still has no slip acceleration
            if (problem.W(i, i) == 0.0 && std::abs(problem.alpha0[i]) <= noise) problem.alpha0[i] = 0.0;
        return problem;
    }

    void run() {
        const std::vector<Mode> unloaded_modes(list.size(), unloaded);
        VecX limits(list.size());
        FrictionProblem problem = pose(unloaded_modes, limits);
        std::vector<Mode> modes = unloaded_modes;
        double change = 0.0;
        for (int it = 0; it < outer_limit; ++it) {
            const VecX f = friction_program(problem.W, problem.alpha0, problem.dims, limits);
            const bool released = it < breaking_passes;
            const auto next = modes_of(problem, f, limits, released);
            const bool same = next == modes;
            modes = next;
            if (same && change <= limit_tolerance) break;
            if (same && it >= outer_patience && it % outer_patience == 0) {  // limits that converge slowly
                if (hold(problem, modes, released)) return;
                apply(unloaded_modes);
            }
            if (it + 1 == outer_limit) {
                if (enumerate(problem, released)) return;
                throw Failure(Failure::Kind::paradox, t, list, std::min(determinant, w.now.determinant));
            }
            change = follow(problem, f, modes, limits);
        }
        clear_forces();
        apply(modes);
    }
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
        if (e == also || at_rest(p, w, e, v)) asked.at_rest.push_back(e);
        else follow_velocity(p, w, e, asked);
    }
    return asked;
}

ModeQuestion first_question(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    ModeQuestion asked{w.state.mode, {}, {}};
    if (p.frictions.empty()) return asked;
    w.state.warm = false;
    update_kinematics(p, w, t, q, v);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        asked.modes[e] = slip_plus;
        if (hardly_slips(p, w, e, v)) asked.at_rest.push_back(e);
        else follow_velocity(p, w, e, asked);
    }
    return asked;
}

void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                   const ModeQuestion& question) {
    if (!question.at_rest.empty()) return Search{p, w, t, q, v, question, question.at_rest}.run();
    set_modes(p, w, question.modes);
    begin_step(p, w, t, q, v);
}

}  // namespace pn
