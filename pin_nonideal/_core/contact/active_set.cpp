#include "contact/active_set.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "contact/queries.hpp"
#include "contact/impact.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "friction/stick_slip.hpp"
#include "math/tolerances.hpp"

namespace pn {

bool slip_opposes_friction(const Program& p, Workspace& w, const VecX& v) {
    const double min_size =
        active_set_parameters.min_direction_acceleration * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (!slips(w.state.mode[e])) continue;
        const Friction& f = p.frictions[e];
        if (f.dim == 1 || f.gap < 0 || is_open(p, w, e) || !at_rest(p, w, e, v)) continue;
        const Vec3 begins = slip_acceleration(p, w, f);
        const double size = begins.norm();
        const double max_deviation = active_set_parameters.max_direction_deviation;
        if (size > min_size && begins.dot(w.state.slip_direction[e]) < (1.0 - max_deviation) * size) return false;
    }
    return true;
}

namespace {

using Choice = std::vector<char>;  // closed flag per gap

bool slides_anywhere(const Program& p, const Workspace& w, const VecX& v) {
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
        if (slips(w.state.mode[e]) && !at_rest(p, w, e, v)) return true;
    return false;
}

// Active sets tried at one state.
struct ActiveSetSearch {
    const Program& p;
    Workspace& w;
    double t;
    const VecX& v;
    const Choice& rest;
    const std::function<void(const OnsetMotion*)>& find_modes;
    const OnsetMotion* joint_motion = nullptr;
    bool needs_opposed_friction = false;  // slip onset must oppose friction
    std::vector<Choice> tried;
    std::optional<Failure> failure;  // failure of the first active set without a motion

    // Return the next active set: the same one if its motion satisfies all conditions, else with one contact more or
    // less. Return nothing if the set has no motion.
    std::optional<Choice> improved_choice(const Choice& choice) {
        tried.push_back(choice);
        set_closed(p, w, choice);
        const bool applies = joint_motion && (joint_motion->is_initial_guess || joint_motion->closed == choice);
        if (const auto no_motion = attempt([&] { find_modes(applies ? joint_motion : nullptr); })) {
            if (no_motion->kind == Failure::Kind::not_finite) throw *no_motion;
            if (!failure) failure = no_motion;
            return std::nullopt;
        }
        if (needs_opposed_friction && !slip_opposes_friction(p, w, v)) return std::nullopt;
        Choice next = choice;
        int change = pulling_contact(p, w);
        if (change < 0) change = fastest_approaching(choice);
        if (change >= 0) next[change] = !next[change];
        return next;
    }

    // Return the open contact with the fastest relative approach acceleration, or -1.
    int fastest_approaching(const Choice& choice) {
        int found = -1;
        double max_ratio = 1.0;
        for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
            if (!rest[i] || choice[i]) continue;
            evaluate_gap(p, w, t, v, i);
            const double beyond = -gap_acceleration(p, w, i) / acceleration_rounding(p, w, i);
            if (beyond <= max_ratio) continue;
            max_ratio = beyond;
            found = i;
        }
        return found;
    }

    bool is_new(const Choice& choice) const { return std::find(tried.begin(), tried.end(), choice) == tried.end(); }

    // Pivot from one active set to the next until one satisfies all conditions.
    bool pivot(Choice choice) {
        while (is_new(choice)) {
            const std::optional<Choice> next = improved_choice(choice);
            if (!next) return false;
            if (*next == choice) return true;
            choice = *next;
        }
        return false;
    }

    // Try all active sets, largest sets first.
    bool enumerate() {
        std::vector<int> list;
        for (int i = 0; i < static_cast<int>(rest.size()); ++i)
            if (rest[i]) list.push_back(i);
        const int max_contacts = needs_opposed_friction ? active_set_parameters.max_aligned_contacts
                                                        : active_set_parameters.max_enumerated_contacts;
        if (static_cast<int>(list.size()) > max_contacts) return false;
        std::vector<unsigned> order(1u << list.size());
        for (unsigned k = 0; k < order.size(); ++k) order[k] = k;
        const auto count = [](unsigned bits) { return __builtin_popcount(bits); };
        std::stable_sort(order.begin(), order.end(), [&](unsigned a, unsigned b) { return count(a) > count(b); });
        for (unsigned bits : order) {
            Choice choice(rest.size(), 0);
            for (size_t k = 0; k < list.size(); ++k) choice[list[k]] = bits >> k & 1u;
            if (is_new(choice) && improved_choice(choice) == choice) return true;
        }
        return false;
    }
};

// Check if two motions are equal to rounding.
bool are_one(const VecX& a, const VecX& other) {
    return (a - other).cwiseAbs().maxCoeff() <=
           active_set_parameters.same_motion * std::max(a.cwiseAbs().maxCoeff(), other.cwiseAbs().maxCoeff());
}

// Add the current motion to a failure with another one.
Failure with_motion(Failure failure, const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    VecX limits(failure.elements.size());
    for (size_t i = 0; i < failure.elements.size(); ++i) {
        const int e = failure.elements[i];
        const Mode mode = w.state.mode[e];
        limits[i] = mode == sticking ? static_limits(p, w, e, t, q, v).reach() : slips(mode) ? w.now.limit[e] : 0.0;
    }
    failure.solutions = Failure::Solutions::several;
    failure.limits.push_back(limits);
    failure.accelerations.push_back(w.now.a);
    return failure;
}

// Selection of the closed contacts at one state.
struct Selection {
    const Program& p;
    Workspace& w;
    double t;
    const VecX& q;
    const VecX& v;
    const OnsetQuery& query;
    const std::function<void(const OnsetMotion*)>& find_modes;
    const RunState before;
    std::optional<Failure> failure{};  // failure of the first active set without a motion

    // Return the motion of all contacts together, by the cone problem.
    std::optional<OnsetMotion> solve_jointly() {
        set_closed(p, w, before.closed);
        set_modes(p, w, before.mode);
        w.state = before;
        return onset_motion(p, w, t, q, v, query);
    }

    // Search from a choice, or from the closed contacts of a joint motion.
    void search_from(const Choice& start) { search_from(start, nullptr); }
    void search_from(const OnsetMotion& joint_motion) { search_from(joint_motion.closed, &joint_motion); }
    void search_from(const Choice& start, const OnsetMotion* joint_motion) {
        if (search(start, joint_motion, true) || search(start, joint_motion, false)) return;
        if (failure) throw *failure;
        throw Failure(Failure::Kind::not_converged, t);
    }

    bool search(const Choice& start, const OnsetMotion* joint_motion, bool needs_opposed_friction) {
        Choice first = start;
        if (query.opening_gap >= 0) first[query.opening_gap] = 0;
        ActiveSetSearch search{p, w, t, v, query.rest, find_modes, joint_motion, needs_opposed_friction, {}, {}};
        if (search.pivot(first) || search.enumerate()) return true;
        if (!failure) failure = search.failure;
        return false;
    }

    // Decide contacts that share a load together. Return false if they share none.
    bool select_shared(std::optional<OnsetMotion>& joint_motion) {
        joint_motion = solve_jointly();
        if (!joint_motion) return false;
        const bool all_stick = joint_motion->closed == query.rest && !joint_motion->slides();
        if (!all_stick && !joint_motion->shared) return false;
        // The friction of sliding contacts follows loads of minimum norm. The cone problem has other shares, so its
        // motion is then only a guess.
        if (!all_stick) joint_motion->is_initial_guess = joint_motion->slides();
        search_from(*joint_motion);
        return true;
    }

    // Decide contacts one by one, which tests uniqueness.
    void select_one_by_one(std::optional<OnsetMotion>& joint_motion) {
        search_from(query.rest);
        // Multipliers of redundant rows do not show if friction at rest is within its cones. Sliding friction follows
        // the minimum-norm loads, unlike the solution of the cone problem.
        const bool are_shared = w.now.rows.redundant && w.state.sticks_anywhere() && !slides_anywhere(p, w, v);
        if (query.prescribed || !(are_shared || !slip_opposes_friction(p, w, v))) return;
        if (!joint_motion) joint_motion = solve_jointly();
        if (joint_motion) search_from(*joint_motion);
        else search_from(query.rest);
    }

    // Decide all contacts together after `unsolved`, the failure of the decisions one by one.
    void select_after_failure(const Failure& unsolved) {
        std::optional<OnsetMotion> joint_motion = solve_jointly();
        // Modes with a negative determinant belong to one of several motions. The cone problem of all contacts gives
        // another motion.
        const bool one_of_several = unsolved.solutions == Failure::Solutions::unproven && !unsolved.accelerations.empty();
        const bool goes_on = w.continues && unsolved.solutions == Failure::Solutions::several;
        // If these active sets have no motion, another one may have.
        const bool has_other = unsolved.kind == Failure::Kind::not_converged || one_of_several || goes_on ||
                               unsolved.solutions == Failure::Solutions::none;
        if (!joint_motion || !(has_other || joint_motion->shared)) throw unsolved;
        if (one_of_several || goes_on) {
            joint_motion->several = true;
            joint_motion->several_element = unsolved.elements.front();
        }
        search_from(*joint_motion);
        if (!one_of_several) return;
        if (are_one(w.now.a, unsolved.accelerations.front())) throw unsolved;
        if (!w.continues) throw with_motion(unsolved, p, w, t, q, v);
    }
};

}  // namespace

void select_active_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                            const OnsetQuery& query, const std::function<void(const OnsetMotion*)>& find_modes) {
    Selection selection{p, w, t, q, v, query, find_modes, w.state};
    const bool many = std::count(query.rest.begin(), query.rest.end(), char(1)) >= active_set_parameters.may_share;
    std::optional<OnsetMotion> joint_motion;
    if (many && query.at_limit.empty() && selection.select_shared(joint_motion)) return;
    const auto unsolved = attempt({Failure::Kind::not_converged, Failure::Kind::paradox},
                                  [&] { selection.select_one_by_one(joint_motion); });
    if (!unsolved) return;
    if (unsolved->kind != Failure::Kind::not_converged && !many) throw *unsolved;
    selection.select_after_failure(*unsolved);
}

}  // namespace pn
