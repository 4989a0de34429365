#include "run/events/event_location.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

using FoundKind = FoundEvent::Kind;

}  // namespace

EventLocator::EventLocator(System& system, Stepper& stepper, ErrorNorm& norm, const std::vector<double>& slip_at_start,
                           const std::vector<char>& pulls, GapWatch& watch)
    : system_(system), stepper_(stepper), norm_(norm), p(system.p), w(system.w), slip_at_start_(slip_at_start),
      search_(system, stepper, pulls, watch), releases_(system, stepper) {}

double EventLocator::shorten_toward_rest(const VecX& rate, double size) {
    const double min_size = parameters.min_shortened_part * size;
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
            size = std::min(size, std::max(parameters.part_toward_rest * std::sqrt(slip / change), min_size));
    }
    return size;
}

double EventLocator::margin_at_end(const Watch& watch) {
    return search_.margin(watch, stepper_.t0 + stepper_.h, stepper_.y1);
}

// Check if slip in several directions has come to rest at the end of a step that does not locate the rest: a fixed step, or
// an adaptive step that begins with slip below the tolerances and without a defined direction.
bool EventLocator::has_arrived(int e) const {
    if (p.frictions[e].dim == 1 || stepper_.method.outside()) return false;
    const double scale = 1.0 + system_.velocity(stepper_.y1).cwiseAbs().maxCoeff();
    const double slip = slip_velocity(w.now, p.frictions[e]).norm();
    if (!(slip < slip_at_start_[e])) return false;
    if (!stepper_.method.adaptive()) return slip <= parameters.arrived_speed * scale;
    if (w.state.is_sticking_deferred[e] || slip_at_start_[e] > min_directed_speed * scale) return false;
    norm_.set_tolerances(stepper_.y0, stepper_.y1, stepper_.h);
    return norm_.of_speed(slip_at_start_[e]) <= 1.0;
}

bool EventLocator::is_rest(double slip) const {
    return slip <= rest_speed * (1.0 + system_.velocity(stepper_.y1).cwiseAbs().maxCoeff());
}

// Check if prescribed motions have stopped an element by the step's end and leave it at rest.
bool EventLocator::is_stopped(int e) const {
    if (w.state.is_sticking_deferred[e] || !is_rest(slip_velocity(w.now, p.frictions[e]).norm())) return false;
    const double largest = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
    return slip_acceleration(p, w, p.frictions[e]).norm() <= parameters.stopped_acceleration * largest;
}

std::optional<double> EventLocator::step_after_stop() const {
    const auto stops = [&](int e) {
        return follows_drives(e) && is_rest(slip_velocity(w.now, p.frictions[e]).norm()) &&
               !is_rest(system_.slip(stepper_.start_rate(), e));
    };
    if (std::none_of(w.now.slipping.begin(), w.now.slipping.end(), stops)) return std::nullopt;
    return parameters.part_after_stop * stepper_.h;
}

// Move the step's end to `size`, or repeat the step if the move is too long.
void EventLocator::correct_end_to(double size) {
    if (std::abs(size - stepper_.h) > parameters.moved_part * stepper_.h) return stepper_.end_at(size);
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
    stepper_.end_at((1.0 - parameters.part_before_rest) * to_rest);
    if (!(stepper_.error() <= 1.0)) throw Failure(Failure::Kind::not_converged, stepper_.t0);
    time_to_rest_ = parameters.part_before_rest * to_rest;
}

// Repeat the step up to the event, or up to an earlier time if it misses a rest.
void EventLocator::step_onto(const Crossing& crossing) {
    const double full = stepper_.h;
    time_to_rest_.reset();
    stepper_.end_at(std::clamp(crossing.part, 0.0, 1.0) * full);
    if (!crossing.jumps) correct_instant(crossing, full);
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
    double size = stepper_.h, margin = margin_at_end(watch), low = 0.0, high = full;
    int stalls = 0;  // passes in a row that hardly reduce the margin
    const double min_rate = of_gap ? rest_speed * (1.0 + system_.velocity(stepper_.y1).cwiseAbs().maxCoeff()) : 0.0;
    for (int it = 0; it < parameters.max_correction_passes; ++it) {
        if (of_gap) rate = gap_rate(p, w, watch.index);
        else if (known_rate) rate = slip_rate_along_mode(p, w, watch.index);
        if (!(rate < -min_rate)) return;  // the margin grows from here on, and no root lies ahead
        (margin > 0.0 ? low : high) = size;
        double next = size - margin / rate;
        if (!(next >= low && next <= high)) next = 0.5 * (low + high);
        const double change = next - size, before = margin;
        if (std::abs(change) <= resolution || (it > 0 && std::abs(change) < parameters.end_tolerance * full)) return;
        correct_end_to(next);
        size = next;
        margin = margin_at_end(watch);
        stalls = std::abs(margin) > parameters.margin_ratio * std::abs(before) ? stalls + 1 : 0;
        if (stalls >= parameters.max_stalls && std::abs(change) < parameters.settled_part * size) return;
        if (const double secant = (margin - before) / change; secant < 0.0) rate = secant;
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
    const auto event_of = [&](FoundKind kind, int index) {
        return FoundEvent{kind, index, stepper_.t0 + stepper_.h};
    };
    std::vector<int> arrived;
    for (int e : w.now.slipping)
        if (has_arrived(e) || (follows_drives(e) && is_stopped(e))) arrived.push_back(e);
    time_to_rest_.reset();
    std::optional<Crossing> crossing = search_.first(arrived);
    if (crossing) step_onto(*crossing);
    for (int k = 0; k < parameters.max_closed_before && crossing; ++k) {
        const std::optional<Crossing> before = search_.deepest_penetration(crossing->watch);
        if (!before) break;
        crossing = before;
        step_onto(*crossing);
    }
    if (const auto lifted = releases_.lift_together()) return lifted;  // which may be earlier
    if (!crossing && !arrived.empty()) return event_of(FoundKind::rest_or_limit, arrived.back());
    if (!crossing || time_to_rest_) return releases_.release_together();
    const Watch& watch = crossing->watch;
    const bool reverses = watch.kind == Watch::Kind::slip && passes_by_rest(watch.index);
    if (const auto released = releases_.release_together()) return released;  // which may be earlier
    if (watch.kind == Watch::Kind::gap) return event_of(FoundKind::touch, watch.index);
    if (watch.kind == Watch::Kind::load) return event_of(FoundKind::lift, watch.index);
    if (watch.kind == Watch::Kind::contact) return event_of(FoundKind::pull, watch.index);
    return event_of(reverses ? FoundKind::reversal : FoundKind::rest_or_limit, watch.index);
}

}  // namespace pn
