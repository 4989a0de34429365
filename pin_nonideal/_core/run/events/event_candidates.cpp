#include "run/events/event_candidates.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/reactions.hpp"
#include "math/roots.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Return the reverse slip speed up to which an element has not stopped.
double EventCandidates::noise() const {
    return parameters.fresh_slip * rest_speed * (1.0 + system_.velocity(stepper_.y1).cwiseAbs().maxCoeff());
}

double EventCandidates::allowance(int e) const {
    if (!w.state.is_sticking_deferred[e]) return 0.0;
    return parameters.raised_rest_speed * (1.0 + system_.velocity(stepper_.y0).cwiseAbs().maxCoeff());
}

// Check if a sticking element is beyond its limit at the step's end, or may have been between two stages.
bool EventCandidates::may_reach_limit(int e) {
    const std::vector<Stepper::RateSample>& rate_samples = stepper_.rate_samples();
    const auto share = [&](size_t k) { return system_.share(*rate_samples[k].rate, e); };
    double min_share = share(0), max_share = min_share, rise = 0.0;
    for (size_t k = 1; k < rate_samples.size(); ++k) {
        min_share = std::min(min_share, share(k));
        max_share = std::max(max_share, share(k));
    }
    const double range = max_share - min_share;
    if (range <= parameters.share_rounding)
        return max_share > 1.0 + parameters.share_rounding || min_share < -1.0 - parameters.share_rounding;
    for (size_t k = 2; k < rate_samples.size(); ++k) {
        const double t0 = rate_samples[k - 2].part, t1 = rate_samples[k - 1].part, t2 = rate_samples[k].part;
        rise = std::max({rise, rise_between(t0, share(k - 2), t1, share(k - 1), t2, share(k)),
                         rise_between(t0, -share(k - 2), t1, -share(k - 1), t2, -share(k))});
    }
    return std::max(max_share, -min_share) + parameters.times_parabola * rise + parameters.range_between * range >
           1.0 + parameters.limit_rounding;
}

// Check if a slipping element has reversed at the step's end, or may have done so inside.
bool EventCandidates::may_stop(int e) const { return slip_along_mode(p, w, e) + allowance(e) < -noise() || dips(e); }

// Check if a slip speed may dip through zero and back. Speeds and their rates are known at the stages and at both ends, and
// give the minima of cubics between them.
bool EventCandidates::dips(int e) const {
    if (stepper_.method.order < 2) return false;
    const std::vector<Stepper::RateSample>& rate_samples = stepper_.rate_samples();
    const double allowed = allowance(e), below_rest = -noise();
    const auto speed = [&](size_t k) { return system_.slip(*rate_samples[k].rate, e) + allowed; };
    double min_speed = HUGE_VAL, max_speed = -HUGE_VAL;
    bool below = false;
    for (size_t k = 0; k < rate_samples.size(); ++k) {
        min_speed = std::min(min_speed, speed(k));
        max_speed = std::max(max_speed, speed(k));
        below |= k > 0 && k + 1 < rate_samples.size() && speed(k) < below_rest;
    }
    if (below) return true;
    if (max_speed <= allowed - below_rest) return false;  // held by sticking elements, it never left rest
    const double dip = parameters.dip_part * (max_speed - min_speed);
    for (size_t k = 0; k + 1 < rate_samples.size(); ++k) {
        const double length = (rate_samples[k + 1].part - rate_samples[k].part) * stepper_.h;
        const double from = speed(k), to = speed(k + 1), leaves = length * system_.slip_rate(*rate_samples[k].rate, e),
                     comes = length * system_.slip_rate(*rate_samples[k + 1].rate, e);
        if (lower_bound_inside(from, leaves, to, comes) < dip && min_inside(from, leaves, to, comes) < dip) return true;
    }
    return false;
}

// Add contacts that begin to carry tension: one of each load-sharing group in which no contact carries tension yet.
void EventCandidates::add_pulls(std::vector<Watch>& list) {
    const auto may_pull = [&](int i) { return !pulls_[i] && normal_force(p, w, i) < 0.0; };
    const int n = static_cast<int>(p.contacts.size());
    int first = 0;
    while (first < n && !may_pull(first)) ++first;
    if (first == n) return;
    std::vector<char> is_reported = pulls_;
    for (int i = first; i < n; ++i) {
        if (is_reported[i] || !may_pull(i)) continue;
        const PullMargin found = contact_pull_margin(p, w, i);
        const auto reported = [&](int j) { return is_reported[j] != 0; };
        if (found.must_pull && std::none_of(found.sharing.begin(), found.sharing.end(), reported))
            list.push_back({Watch::Kind::contact, i});
        for (int j : found.sharing) is_reported[j] = 1;
    }
}

// Check if the normal force of a closed contact is negative at the step's end, or may have been between two stages.
bool EventCandidates::may_pull(int gap) {
    const std::vector<Stepper::RateSample>& rate_samples = stepper_.rate_samples();
    const auto load = [&](size_t k) { return system_.load(*rate_samples[k].rate, gap); };
    double min_load = load(0), max_load = min_load, fall = 0.0;
    for (size_t k = 1; k < rate_samples.size(); ++k) {
        min_load = std::min(min_load, load(k));
        max_load = std::max(max_load, load(k));
    }
    for (size_t k = 2; k < rate_samples.size(); ++k)
        fall = std::max(fall, rise_between(rate_samples[k - 2].part, -load(k - 2), rate_samples[k - 1].part, -load(k - 1),
                                           rate_samples[k].part, -load(k)));
    return min_load - parameters.times_parabola * fall - parameters.range_between * (max_load - min_load) <
           -load_rounding(p, w, gap);
}

std::vector<Watch> EventCandidates::find(const std::vector<int>& arrived) {
    std::vector<Watch> list;
    if (stepper_.method.order > 1) add_pulls(list);
    for (int e : w.now.loaded_elements) {
        if (w.state.mode[e] != sticking) {
            const bool has_arrived = std::find(arrived.begin(), arrived.end(), e) != arrived.end();
            if (!has_arrived && may_stop(e)) list.push_back({Watch::Kind::slip, e});
        } else if (!w.state.is_hyperstatic && may_reach_limit(e)) {
            list.push_back({Watch::Kind::stick, e});
        }
    }
    if (p.gaps.empty()) return list;
    if (!w.now.rows.redundant)  // redundant loads are checked together
        for (int i : w.now.closed_gaps)
            if (!is_bare(p, i) && may_pull(i)) list.push_back({Watch::Kind::load, i});
    for (const GapSearch::Candidate& candidate : gaps_.find_candidates())
        list.push_back({Watch::Kind::gap, candidate.gap});
    return list;
}

}  // namespace pn
