#include "run/events/event_location.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/onset.hpp"
#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "friction/stick_slip.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

using FoundKind = FoundEvent::Kind;

}  // namespace

EventLocator::EventLocator(System& system, Stepper& stepper, ErrorNorm& norm, const std::vector<double>& slip_at_start,
                           const std::vector<char>& pulls, GapWatch& watch)
    : system_(system), stepper_(stepper), norm_(norm), p(system.p), w(system.w), slip_at_start_(slip_at_start),
      search_(system, stepper, pulls, watch) {}

double EventLocator::shorten_toward_rest(const VecX& rate, double size) {
    const double least = parameters.least_shortened * size;
    for (int e : w.now.slipping) {
        const Friction& f = p.frictions[e];
        if (f.dim == 1) continue;
        const Block& block = p.blocks[f.block];
        system_.v = system_.velocity(rate);
        multiply(block, w.now.A, system_.v, w.scratch.r);
        const double slip = slip_velocity(w.now, f).squaredNorm();
        double change = 0.0;
        for (int k = 0; k < f.dim; ++k) {
            const double along = w.scratch.r[block.row + k] - w.now.b[block.row + k];
            change += along * along;
        }
        if (slip < change * size * size)
            size = std::min(size, std::max(parameters.part_toward_rest * std::sqrt(slip / change), least));
    }
    return size;
}

double EventLocator::margin_at_end(const Watch& watch) {
    return search_.margin(watch, stepper_.t0 + stepper_.h, stepper_.y1);
}

// Check if slip in several directions has come to rest at the end of a fixed step.
bool EventLocator::has_arrived(int e) const {
    if (p.frictions[e].dim == 1 || stepper_.method.adaptive()) return false;
    const double speed = system_.velocity(stepper_.y1).cwiseAbs().maxCoeff();
    const double slip = slip_velocity(w.now, p.frictions[e]).norm();
    return slip < slip_at_start_[e] && slip <= parameters.arrived_speed * (1.0 + speed);
}

void EventLocator::end_step_at(double size) {
    stepper_.take_again(size);
    system_.project_and_evaluate(stepper_.t0 + size, stepper_.y1, stepper_.end_rate());
}

// Move the step's end to `size`, or repeat the step if the move is too long.
void EventLocator::correct_end_to(double size) {
    if (std::abs(size - stepper_.h) > parameters.moved_part * stepper_.h) return end_step_at(size);
    stepper_.move_end(size - stepper_.h);
    system_.project_and_evaluate(stepper_.t0 + stepper_.h, stepper_.y1, stepper_.end_rate());
}

// Check if a step misses the rest of slip in several directions, at which it should end.
// Slip turns as it comes to rest. The component across the final direction vanishes as a power 1 + k of the component
// along it, for any k > 0. No polynomial resolves this. When the component along the direction has vanished, the
// remaining slip is an error of the step. The error estimate counts as well, because the repeated step has its stages
// at other times than the accepted step.
bool EventLocator::misses_rest(const Watch& watch) const {
    if (watch.kind != Watch::Kind::slip || p.frictions[watch.index].dim == 1) return false;
    if (!stepper_.method.adaptive() || stepper_.method.outside()) return false;
    const bool accurate = stepper_.error() <= 1.0;
    norm_.set_tolerances(stepper_.y0, stepper_.y1, stepper_.h);
    const bool rests = norm_.of_speed(slip_velocity(w.now, p.frictions[watch.index]).norm()) <= 1.0;
    return !(accurate && rests) &&
           norm_.of_speed(system_.slip(stepper_.start_rate(), watch.index)) > parameters.negligible_slip;
}

// End the step before the rest. The following steps begin with less slip, and their errors are proportionally smaller.
void EventLocator::end_before_rest() {
    const double to_rest = stepper_.h;
    end_step_at((1.0 - parameters.part_before_rest) * to_rest);
    if (!(stepper_.error() <= 1.0)) throw Failure(Failure::Kind::not_converged, stepper_.t0);
    time_to_rest_ = parameters.part_before_rest * to_rest;
}

// Repeat the step up to the event, or up to an earlier time if it misses a rest.
void EventLocator::step_onto(const Crossing& crossing) {
    const double full = stepper_.h;
    time_to_rest_.reset();
    end_step_at(std::clamp(crossing.part, 0.0, 1.0) * full);
    if (!crossing.leaps) correct_instant(crossing, full);
    if (misses_rest(crossing.watch)) end_before_rest();
}

// Correct the instant by Newton's method on the remaining margin. The rate of the margin is known for gaps and for slip
// along one direction. Other margins use the rate of the interpolant, then a secant.
void EventLocator::correct_instant(const Crossing& crossing, double full) {
    const Watch& watch = crossing.watch;
    const bool of_gap = watch.kind == Watch::Kind::gap;
    const bool known_rate = of_gap || (watch.kind == Watch::Kind::slip && p.frictions[watch.index].dim == 1);
    const double resolution = parameters.time_rounding * std::max(std::abs(stepper_.t0), full);
    double rate = crossing.slope / full;
    // Bracket of the instant. Without a bracket Newton's method could run to the step's end, past other events. Two
    // cases cause this: the motion differs from the interpolant, or other contacts hold the gap, so that its rate is
    // only rounding.
    double size = stepper_.h, here = margin_at_end(watch), low = 0.0, high = full;
    const double still = of_gap ? rest_speed * (1.0 + system_.velocity(stepper_.y1).cwiseAbs().maxCoeff()) : 0.0;
    for (int it = 0; it < parameters.correction_passes; ++it) {
        if (of_gap) rate = gap_rate(p, w, watch.index);
        else if (known_rate) rate = slip_rate_along_mode(p, w, watch.index);
        if (!(rate < -still)) return;  // the margin grows from here on, and no root lies ahead
        (here > 0.0 ? low : high) = size;
        double next = size - here / rate;
        if (!(next >= low && next <= high)) next = 0.5 * (low + high);
        const double change = next - size, before = here;
        if (std::abs(change) <= resolution || (it > 0 && std::abs(change) < parameters.end_tolerance * full)) return;
        correct_end_to(next);
        size = next;
        here = margin_at_end(watch);
        if (const double secant = (here - before) / change; secant < 0.0) rate = secant;
    }
}

// Check if slip in several directions turns without coming to rest. At rest hardly any of the slip at the step's start
// is left.
bool EventLocator::passes_by_rest(int e) const {
    if (p.frictions[e].dim == 1) return false;
    const double speed = system_.velocity(stepper_.y1).cwiseAbs().maxCoeff();
    const double slip = slip_velocity(w.now, p.frictions[e]).norm();
    return slip > parameters.rest_part * slip_at_start_[e] && slip > parameters.passing_speed * (1.0 + speed);
}

std::optional<FoundEvent> EventLocator::locate() {
    const auto found = [&](FoundKind kind, int index) {
        return FoundEvent{kind, index, stepper_.t0 + stepper_.h};
    };
    for (auto e = w.now.slipping.rbegin(); e != w.now.slipping.rend(); ++e)
        if (has_arrived(*e)) return found(FoundKind::rest_or_limit, *e);
    time_to_rest_.reset();
    std::optional<Crossing> crossing = search_.first();
    if (crossing) step_onto(*crossing);
    for (int k = 0; k < parameters.most_closed_before && crossing; ++k) {
        const std::optional<Crossing> before = search_.deepest_penetration(crossing->watch);
        if (!before) break;
        crossing = before;
        step_onto(*crossing);
    }
    if (const auto lifted = lift_together()) return lifted;  // which may be earlier
    if (!crossing || time_to_rest_) return release_together();
    const Watch& watch = crossing->watch;
    const bool reverses = watch.kind == Watch::Kind::slip && passes_by_rest(watch.index);
    if (const auto released = release_together()) return released;  // which may be earlier
    if (watch.kind == Watch::Kind::gap) return found(FoundKind::touch, watch.index);
    if (watch.kind == Watch::Kind::load) return found(FoundKind::lift, watch.index);
    if (watch.kind == Watch::Kind::contact) return found(FoundKind::pull, watch.index);
    return found(reverses ? FoundKind::reversal : FoundKind::rest_or_limit, watch.index);
}

// Return the acceleration with which sticking elements begin to slip at a state of the step. Return nothing if forces
// within all limits can hold them.
std::optional<double> EventLocator::release_rate(double t, const VecX& y, const std::vector<Mode>& modes,
                                                 ModeQuestion& asked) {
    system_.read(y);
    // Selecting modes can reverse the slip of an element that has just come to rest. The step keeps its own directions.
    const std::vector<Vec3> directions = w.state.slip_direction, last_directions = w.state.last_direction;
    asked = {modes, {}, {}};
    for (int e = 0; e < system_.ne; ++e)
        if (!is_open(p, w, e) && at_rest(p, w, e, system_.v)) asked.at_rest.push_back(e);
    double rate = 0.0;
    std::optional<Failure> paradox;
    try {
        resolve_modes(p, w, t, system_.q, system_.v, asked);
        for (int e : asked.at_rest)
            if (modes[e] == sticking && w.state.mode[e] != sticking)
                rate = std::max(rate, std::abs(slip_rate_along_mode(p, w, e)));
    } catch (const Failure& failure) {  // sticking fails: unilateral contacts change together with the elements
        const bool is_paradox = failure.kind == Failure::Kind::paradox;
        if (p.gaps.empty() || (!is_paradox && failure.kind != Failure::Kind::not_converged)) throw;
        if (is_paradox) paradox = failure;
        rate = HUGE_VAL;
    }
    const double noise = relative_acceleration_rounding * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
    set_modes(p, w, modes);
    w.state.slip_direction = directions;
    w.state.last_direction = last_directions;
    // Contacts hold as long as any forces within their cones do, not only those of minimum norm.
    const bool hold = rate > noise && !p.gaps.empty() && closed_contacts_hold(p, w, t, system_.q, system_.v);
    if (paradox && !hold) throw *paradox;
    begin_step(p, w, t, system_.q, system_.v);
    if (rate <= noise || hold) return std::nullopt;  // an element held by others does not move, whatever its force
    return rate;
}

std::optional<double> EventLocator::release_rate_at_end(const std::vector<Mode>& modes, ModeQuestion& asked) {
    return release_rate(stepper_.t0 + stepper_.h, stepper_.y1, modes, asked);
}

// Check if nonnegative loads exist for the closed contacts, at the start, at the stages and at the end of the step.
bool EventLocator::all_press() {
    for (const Stepper::Look& look : stepper_.looks())
        for (int i : w.now.touching)
            if (system_.load(*look.rate, i) < 0.0) return false;
    return true;
}

// Locate the lift-off of redundant contacts. They stay closed as long as nonnegative loads exist, even if the
// minimum-norm loads are not all nonnegative. Bisects the step for the first instant without nonnegative loads.
std::optional<FoundEvent> EventLocator::lift_together() {
    if (p.gaps.empty() || !w.now.rows.redundant || all_press()) return std::nullopt;
    double low = 0.0, high = stepper_.h;
    while (high - low > parameters.release_width * std::max(std::abs(stepper_.t0), stepper_.h)) {
        const double mid = 0.5 * (low + high);
        end_step_at(mid);
        (all_press() ? low : high) = mid;
    }
    if (low > 0.0) {
        end_step_at(low);
        if (const auto released = release_together()) return released;  // the release is earlier
    }
    end_step_at(high);
    return FoundEvent{FoundKind::lift, -1, stepper_.t0 + stepper_.h};
}

// Return the part of the step at which its interpolant releases the sticking elements. `rate`: their slip acceleration
// at the step's end. The search approaches the instant from later times. It uses secants of the acceleration, which
// falls to zero toward the instant if limits do not jump, and bisection otherwise.
double EventLocator::release_part(double rate, const std::vector<Mode>& modes, ModeQuestion& asked) {
    const double full = stepper_.h, width = parameters.release_width * std::max(std::abs(stepper_.t0) / full, 1.0);
    double low = 0.0, high = 1.0, beyond = 0.0, rate_beyond = 0.0;
    bool falls = false;  // the rate falls toward the instant
    VecX y(system_.ny);
    stepper_.make_interpolant();
    while (high - low > width) {
        double next = 0.5 * (low + high);
        if (falls) {
            const double vanishes = high - rate * (beyond - high) / (rate_beyond - rate);
            if (high - vanishes <= width) break;
            if (vanishes > low) next = vanishes + parameters.short_of_root * (high - vanishes);
        }
        const double t = stepper_.t0 + next * full;
        stepper_.interpolate(next, y);
        system_.read(y);
        update_kinematics(p, w, t, system_.q, system_.v);
        const std::optional<double> there = release_rate(t, y, modes, asked);
        falls = there && rate < HUGE_VAL && *there < parameters.least_fall * rate;
        if (there) {
            beyond = std::exchange(high, next);
            rate_beyond = std::exchange(rate, *there);
        } else {
            low = next;
        }
    }
    return high;
}

// Check sticking elements inside a step at rest, and end the step at the first place of release. Return their slip
// acceleration there. Steps at rest can be long relative to changes of user functions.
std::optional<double> EventLocator::release_rate_inside(const std::vector<Mode>& modes, ModeQuestion& asked) {
    if (!p.asks_functions || (system_.velocity(stepper_.y1).array() != 0.0).any()) return std::nullopt;
    const double whole = stepper_.h;
    for (int k = 1; k < parameters.places_inside; ++k) {
        const double t = stepper_.t0 + whole * k / parameters.places_inside;
        system_.read(stepper_.y1);
        update_kinematics(p, w, t, system_.q, system_.v);
        if (!release_rate(t, stepper_.y1, modes, asked)) continue;
        end_step_at(t - stepper_.t0);
        return release_rate_at_end(modes, asked);
    }
    system_.read(stepper_.y1);
    begin_step(p, w, stepper_.t0 + whole, system_.q, system_.v);
    return std::nullopt;
}

// Locate the release of redundant sticking elements. The multiplier of a single element decides nothing: the elements
// hold as long as some forces within all limits do. Elements that slip without moving are included. The step is
// repeated up to the release on its interpolant. It is extended slightly if its own end does not show the release.
std::optional<FoundEvent> EventLocator::release_together() {
    if (!w.state.indeterminate) return std::nullopt;
    const std::vector<Mode> modes = w.state.mode;
    ModeQuestion asked;
    std::optional<double> rate = release_rate_at_end(modes, asked);
    if (!rate) rate = release_rate_inside(modes, asked);
    if (!rate) return std::nullopt;
    const double full = stepper_.h;
    const double part = release_part(*rate, modes, asked);
    for (double later = 0.0;; later = std::max(parameters.further_part * later, parameters.least_later)) {
        end_step_at(std::min(part + later, 1.0) * full);
        if (release_rate_at_end(modes, asked) || part + later >= 1.0) break;
    }
    return FoundEvent{FoundKind::released_together, asked.at_rest.front(), stepper_.t0 + stepper_.h};
}

}  // namespace pn
