#include "run/events/release_location.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/onset.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "friction/stick_slip.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Check if the shares of the motion in the workspace hold all sticking elements, at the state last read.
bool ReleaseLocator::shares_hold_at(double t) {
    return shares_hold(p, w, w.now.loaded_elements, t, system_.q, system_.v);
}

// Return the acceleration with which sticking elements begin to slip at a state of the step. Return nothing if forces
// within all limits can hold them.
std::optional<double> ReleaseLocator::release_rate(double t, const VecX& y, const std::vector<Mode>& modes,
                                                 ModeQuery& mode_query) {
    system_.read(y);
    // Selecting modes can reverse the slip of an element that has just come to rest. The step keeps its own directions.
    const std::vector<Vec3> directions = w.state.slip_direction, last_directions = w.state.last_direction;
    mode_query = {modes, {}, {}};
    for (int e = 0; e < system_.ne; ++e)
        if (!is_open(p, w, e) && at_rest(p, w, e, system_.v)) mode_query.at_rest.push_back(e);
    // Contacts hold as long as any forces within their cones do, not only those of minimum norm.
    if (!p.gaps.empty() && closed_contacts_hold(p, w, t, system_.q, system_.v)) {
        begin_step(p, w, t, system_.q, system_.v);
        return std::nullopt;
    }
    double rate = 0.0;
    const auto failure = attempt({Failure::Kind::paradox, Failure::Kind::not_converged}, [&] {
        resolve_modes(p, w, t, system_.q, system_.v, mode_query);
        for (int e : mode_query.at_rest)
            if (modes[e] == sticking && w.state.mode[e] != sticking)
                rate = std::max(rate, std::abs(slip_rate_along_mode(p, w, e)));
    });
    if (failure) rate = HUGE_VAL;  // sticking fails: unilateral contacts change together with the elements
    const double noise = relative_acceleration_rounding * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
    set_modes(p, w, modes);
    w.state.slip_direction = directions;
    w.state.last_direction = last_directions;
    if (failure && (p.gaps.empty() || failure->kind == Failure::Kind::paradox)) throw *failure;
    begin_step(p, w, t, system_.q, system_.v);
    if (rate <= noise) return std::nullopt;  // an element held by others does not move, whatever its force
    return rate;
}

std::optional<double> ReleaseLocator::release_rate_at_end(const std::vector<Mode>& modes, ModeQuery& mode_query) {
    return release_rate(stepper_.t0 + stepper_.h, stepper_.y1, modes, mode_query);
}

// Check if nonnegative loads exist for the closed contacts, at the start, at the stages and at the end of the step.
bool ReleaseLocator::all_press() {
    for (const Stepper::RateSample& sample : stepper_.rate_samples())
        for (int i : w.now.closed_gaps)
            if (system_.load(*sample.rate, i) < 0.0) return false;
    return true;
}

// Locate the lift-off of redundant contacts. Redundant contacts stay closed as long as nonnegative loads exist, even if the
// minimum-norm loads are not all nonnegative. Bisects the step for the first instant without nonnegative loads.
std::optional<FoundEvent> ReleaseLocator::lift_together() {
    if (p.gaps.empty() || !w.now.rows.redundant || all_press()) return std::nullopt;
    double low = 0.0, high = stepper_.h;
    while (high - low > parameters.time_tolerance * std::max(std::abs(stepper_.t0), stepper_.h)) {
        const double mid = 0.5 * (low + high);
        stepper_.end_at(mid);
        (all_press() ? low : high) = mid;
    }
    if (low > 0.0) {
        stepper_.end_at(low);
        if (const auto released = release_together()) return released;  // the release is earlier
    }
    stepper_.end_at(high);
    return FoundEvent::joint_lift(stepper_.t0 + stepper_.h);
}

// Return the fraction of the step at which its interpolant releases the sticking elements. `rate`: their slip acceleration
// at the step's end. The search approaches the instant from later times. The search uses secants of the acceleration, which
// falls to zero toward the instant if limits do not jump, and bisection otherwise.
double ReleaseLocator::release_part(double rate, const std::vector<Mode>& modes, ModeQuery& mode_query) {
    const double full = stepper_.h, width = parameters.time_tolerance * std::max(std::abs(stepper_.t0) / full, 1.0);
    double low = 0.0, high = 1.0, beyond = 0.0, rate_beyond = 0.0;
    bool falls = false;  // the rate falls toward the instant
    VecX y(system_.ny);
    stepper_.make_interpolant();
    for (int asks = 0; high - low > width; ++asks) {
        double next = 0.5 * (low + high);
        if (low == 0.0 && asks == parameters.asks_before_start) next = width;  // released from the start on
        if (falls) {
            const double vanishes = high - rate * (beyond - high) / (rate_beyond - rate);
            if (high - vanishes <= width) break;
            if (vanishes > low) next = vanishes + parameters.short_of_root * (high - vanishes);
        }
        const double t = stepper_.t0 + next * full;
        stepper_.interpolate(next, y);
        system_.read(y);
        begin_step(p, w, t, system_.q, system_.v);
        std::optional<double> found_rate;
        if (!shares_hold_at(t)) found_rate = release_rate(t, y, modes, mode_query);
        falls = found_rate && rate < HUGE_VAL && *found_rate < parameters.max_rate_ratio * rate;
        if (found_rate) {
            beyond = std::exchange(high, next);
            rate_beyond = std::exchange(rate, *found_rate);
        } else {
            low = next;
        }
    }
    return high;
}

// Check sticking elements inside a step at rest, and end the step at the first place of release. Return their slip
// acceleration there. Steps at rest can be long relative to changes of user functions.
std::optional<double> ReleaseLocator::release_rate_inside(const std::vector<Mode>& modes, ModeQuery& mode_query) {
    if (!p.changes_at_rest() || (system_.velocity(stepper_.y1).array() != 0.0).any()) return std::nullopt;
    const double whole = stepper_.h;
    for (int k = 1; k < parameters.places_inside; ++k) {
        const double t = stepper_.t0 + whole * k / parameters.places_inside;
        system_.read(stepper_.y1);
        update_kinematics(p, w, t, system_.q, system_.v);
        if (!release_rate(t, stepper_.y1, modes, mode_query)) continue;
        stepper_.end_at(t - stepper_.t0);
        return release_rate_at_end(modes, mode_query);
    }
    system_.read(stepper_.y1);
    begin_step(p, w, stepper_.t0 + whole, system_.q, system_.v);
    return std::nullopt;
}

// Locate the release of redundant sticking elements. The multiplier of a single element decides nothing: the elements
// hold as long as some forces within all limits do. Elements in a slip mode with zero slip velocity are included. The step
// is repeated up to the release on its interpolant. The repeated step is extended slightly if its end does not show the
// release.
std::optional<FoundEvent> ReleaseLocator::release_together() {
    if (!w.state.is_hyperstatic) return std::nullopt;
    const std::vector<Mode> modes = w.state.mode;
    ModeQuery mode_query;
    std::optional<double> rate;
    system_.read(stepper_.y1);
    if (!shares_hold_at(stepper_.t0 + stepper_.h)) rate = release_rate_at_end(modes, mode_query);
    if (!rate) rate = release_rate_inside(modes, mode_query);
    if (!rate) return std::nullopt;
    const double full = stepper_.h;
    const double part = release_part(*rate, modes, mode_query);
    for (double later = 0.0;; later = std::max(parameters.further_part * later, parameters.min_extension)) {
        stepper_.end_at(std::min(part + later, 1.0) * full);
        if (release_rate_at_end(modes, mode_query) || part + later >= 1.0) break;
    }
    return FoundEvent{FoundEvent::Kind::released_together, mode_query.at_rest.front(), stepper_.t0 + stepper_.h};
}

}  // namespace pn
