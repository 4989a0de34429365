#include "run/event_location.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/slip.hpp"
#include "dynamics/step_start.hpp"
#include "friction/modes.hpp"

namespace pn {

namespace {

using EventKind = FoundEvent::Kind;

// --- What may have happened in a step. Speeds [rad/s or m/s] grow with the largest of the scene, as 1 + speed.
// Part of a limit by which rounding may pass it: of a force that stands still, and of the share that stages see.
constexpr double limit_rounding = 1e-12, share_rounding = 1e-9;
// Part of the range of the shares at the stages by which they may go further in between.
constexpr double range_between = 0.5;
// Part of the speed of rest by which an element that has just begun to slip may lie on the other side.
constexpr double fresh_slip = 1e-3;
// Slip of several directions below this has come to rest in fixed steps, which do not locate it.
constexpr double arrived_speed = 1e-7;
// Slip that has more than this part left of what its step began with, and more than this speed, passes by rest.
constexpr double rest_part = 0.05, passing_speed = 1e-6;
// A fixed step covers this part of the time to rest, and this part of its own length at least.
constexpr double part_toward_rest = 0.5, least_shortened = 1e-3;
// A least speed between two stages counts as a dip below zero where it is below this part of the speeds' range: the
// cubics through the stages miss the motion by less.
constexpr double dip_part = 0.02;

// --- The interpolant
constexpr int location_grid = 24;  // points of a step at which a margin is looked at first
constexpr int dip_passes = 40;     // golden sections: a dip of 1e-16 of the margin's own change
constexpr double beyond = 2.0;     // part of a step: none of it
// A parabola through three points lies lower than the middle one by an eighth of its second difference at most; twice
// that is looked into.
constexpr double parabola_part = 0.25;
constexpr int root_passes = 60;
constexpr int start_halvings = 30;  // of the first part, in which a slip from rest may have come to rest again
constexpr double root_width = 1e-13, root_margin = 1e-13;  // the guess of a step that is taken again

// --- The step taken again
constexpr int correction_passes = 12, sure_passes = 3;  // after the latter rounding of margins ends it
constexpr double time_rounding = 2e-16, corrected_width = 1e-13;
constexpr double difference_part = 1e-6, least_difference = 1e-12;  // of the step, and [s]
constexpr double release_width = 1e-12;                             // bisection of the instant of a release

// Root of a margin between a part of the step where it is positive and one where it is negative: secants, kept inside
// (Illinois).
template <class Margin>
double root_between(double low, double margin_low, double high, double margin_high, const Margin& margin) {
    if (margin_low <= 0.0) return low;  // it starts at zero and goes the wrong way at once
    int side = 0;
    for (int it = 0; it < root_passes && high - low > root_width; ++it) {
        double mid = (low * margin_high - high * margin_low) / (margin_high - margin_low);
        if (!(mid > low && mid < high)) mid = 0.5 * (low + high);
        const double here = margin(mid);
        if (std::abs(here) < root_margin) return mid;
        if (here > 0.0) {
            low = mid;
            margin_low = here;
            if (side == 1) margin_high *= 0.5;
            side = 1;
        } else {
            high = mid;
            margin_high = here;
            if (side == -1) margin_low *= 0.5;
            side = -1;
        }
    }
    return high;
}

// The same for a margin that is zero at the start: where it has risen before it falls, the root after that; else the
// start, from where it goes the wrong way at once.
template <class Margin>
double root_after_start(double high, double margin_high, const Margin& margin) {
    for (int it = 0; it < start_halvings; ++it) {
        const double low = 0.5 * high, margin_low = margin(low);
        if (margin_low > 0.0) return root_between(low, margin_low, high, margin_high, margin);
        high = low;
        margin_high = margin_low;
    }
    return 0.0;
}

// Least value of the cubic with values u0, u1 and slopes a0, a1 at 0 and 1 inside, where it has one there.
double least_inside(double u0, double a0, double u1, double a1) {
    // u' = a0 + 2 b x + 3 c x^2
    const double b = 3.0 * (u1 - u0) - 2.0 * a0 - a1, c = a0 + a1 - 2.0 * (u1 - u0);
    const double root = std::sqrt(b * b - 3.0 * a0 * c);  // no number: no extremum
    const double q = -(b + std::copysign(root, b));
    double least = HUGE_VAL;
    for (double x : {q / (3.0 * c), a0 / q})  // of a maximum and a minimum
        if (x > 0.0 && x < 1.0) least = std::min(least, u0 + x * (a0 + x * (b + x * c)));
    return least;
}

// A place between a and b where the margin is negative, by golden sections toward its least value; none: b.
template <class Margin>
double dip_between(double a, double b, const Margin& margin, double& value) {
    constexpr double golden = 0.3819660112501051;
    const double end = b;
    double x1 = a + golden * (b - a), x2 = b - golden * (b - a), g1 = margin(x1), g2 = margin(x2);
    for (int it = 0; it < dip_passes; ++it) {
        if (std::min(g1, g2) < 0.0) {
            value = std::min(g1, g2);
            return g1 < g2 ? x1 : x2;
        }
        if (g1 < g2) {
            b = x2; x2 = x1; g2 = g1;
            g1 = margin(x1 = a + golden * (b - a));
        } else {
            a = x1; x1 = x2; g1 = g2;
            g2 = margin(x2 = b - golden * (b - a));
        }
    }
    return end;
}

}  // namespace

EventLocator::EventLocator(System& system, Stepper& stepper, const std::vector<double>& slip_at_start,
                           const std::vector<char>& pulls)
    : system_(system), stepper_(stepper), p(system.p), w(system.w), slip_at_start_(slip_at_start), pulls_(pulls),
      probe_(VecX::Zero(system.ny)), probe_rate_(probe_) {
    for (int i = 0; i < stepper.stages; ++i)
        if (i == 0 || (stepper.method.C && stepper.method.C[i] < 1.0)) by_time_.push_back(i);
    std::stable_sort(by_time_.begin(), by_time_.end(), [&](int i, int j) { return time_of(i) < time_of(j); });
    by_time_.push_back(stepper.stages);
}

double EventLocator::shorten_toward_rest(const VecX& rate, double size) {
    for (int e = 0; e < system_.ne; ++e) {
        const Friction& f = p.frictions[e];
        if (f.dim == 1 || !slips(w.state.mode[e])) continue;
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
            size = std::min(size, std::max(part_toward_rest * std::sqrt(slip / change), least_shortened * size));
    }
    return size;
}

// Positive before the event, zero at it. The workspace must be evaluated at the state.
double EventLocator::margin(const Watch& watch, double t, const VecX& y) {
    if (watch.kind == Watch::Kind::contact) return w.now.lam[p.blocks[p.contacts[watch.index]].row];
    if (watch.kind == Watch::Kind::slip) return slip_along_mode(p, w, watch.index);
    system_.read(y);
    return static_limit(p, w, watch.index, t, system_.q, system_.v) * (1.0 + limit_rounding) -
           friction_force(p, w, watch.index).norm();
}

double EventLocator::margin_at_end(const Watch& watch) {
    return margin(watch, stepper_.t0 + stepper_.h, stepper_.y1);
}

// Slip of several directions that has come to rest at the end of a fixed step.
bool EventLocator::has_arrived(int e) const {
    if (p.frictions[e].dim == 1 || stepper_.method.adaptive() || w.state.mode[e] == sticking) return false;
    const double speed = system_.velocity(stepper_.y1).cwiseAbs().maxCoeff();
    const double slip = slip_velocity(w.now, p.frictions[e]).norm();
    return slip < slip_at_start_[e] && slip <= arrived_speed * (1.0 + speed);
}

// Whether what sticks is past its limit at the step's end, or may have been inside, between two stages.
bool EventLocator::may_reach_limit(int e) {
    const bool past = margin({Watch::Kind::stick, e}, stepper_.t0 + stepper_.h, stepper_.y1) < 0.0;
    double least = HUGE_VAL, most = -HUGE_VAL;
    for (int i = 0; i < stepper_.stages; ++i) {
        const double share = system_.share(stepper_.rates[i], e);
        least = std::min(least, share);
        most = std::max(most, share);
    }
    const double range = most - least, largest = std::max(std::abs(least), std::abs(most));
    return past || (largest + range_between * range > 1.0 + share_rounding && range > share_rounding);
}

// Whether what slips goes the other way at the step's end, or may have done so inside.
bool EventLocator::may_stop(int e) const {
    const double speed = system_.velocity(stepper_.y1).cwiseAbs().maxCoeff();
    const double noise = fresh_slip * rest_speed * (1.0 + speed);
    return slip_along_mode(p, w, e) < -noise || dips(e, noise);
}

// A dip through zero and back. Speeds and their rates are known at the stages and at both ends: cubics through them
// tell where one may have been below zero in between.
bool EventLocator::dips(int e, double noise) const {
    if (stepper_.method.order < 2) return false;
    const std::vector<VecX>& rates = stepper_.rates;
    const auto speed = [&](int i) { return system_.slip(rates[i], e); };
    double least = HUGE_VAL, most = -HUGE_VAL;
    bool below = false;
    for (int i : by_time_) {
        least = std::min(least, speed(i));
        most = std::max(most, speed(i));
        below |= i > 0 && i < stepper_.stages && speed(i) < -noise;
    }
    // Slip of several directions that begins in this step first turns into its direction: that it comes to rest again
    // shows where it has risen before.
    if (p.frictions[e].dim > 1 && speed(0) < rest_part * most)
        return below && speed(by_time_[1]) > 0.0 && speed(by_time_[2]) > 0.0;
    if (below) return true;
    for (size_t k = 0; k + 1 < by_time_.size(); ++k) {
        const int i = by_time_[k], j = by_time_[k + 1];
        const double length = (time_of(j) - time_of(i)) * stepper_.h;
        const double inside = least_inside(speed(i), length * system_.slip_rate(rates[i], e), speed(j),
                                           length * system_.slip_rate(rates[j], e));
        if (inside < dip_part * (most - least)) return true;
    }
    return false;
}

// Part of the step at which a stage stands, or its end.
double EventLocator::time_of(int stage) const { return stage < stepper_.stages ? stepper_.method.C[stage] : 1.0; }

// What lies past its event at the step's end (the workspace is evaluated there), or may have crossed inside.
std::vector<EventLocator::Watch> EventLocator::crossed() {
    std::vector<Watch> list;
    if (stepper_.method.order > 1)
        for (int i = 0; i < static_cast<int>(p.contacts.size()); ++i)
            if (!pulls_[i] && w.now.lam[p.blocks[p.contacts[i]].row] < 0.0)
                list.push_back({Watch::Kind::contact, i});
    for (int e = 0; e < system_.ne; ++e) {
        if (w.state.mode[e] != sticking) {
            if (may_stop(e)) list.push_back({Watch::Kind::slip, e});
            continue;
        }
        if (!w.state.indeterminate && may_reach_limit(e)) list.push_back({Watch::Kind::stick, e});
    }
    return list;
}

// Part of the step at which a watched margin first falls below zero, on a grid and between its points; beyond the step
// where it does not.
double EventLocator::first_crossing(const Watch& watch) {
    const bool by_kinematics = watch.kind == Watch::Kind::slip && !system_.on_constraints;
    const auto margin_at = [&](double part) {
        const double t = stepper_.t0 + part * stepper_.h;
        stepper_.interpolate(part, probe_);
        if (by_kinematics) {
            system_.read(probe_);
            update_kinematics(p, w, t, system_.q, system_.v);
        } else {
            system_.derivative(t, probe_, probe_rate_);
        }
        return margin(watch, t, probe_);
    };
    constexpr double apart = 1.0 / location_grid;
    double g[location_grid + 1];
    g[0] = margin_at(0.0);
    const double speed = system_.velocity(stepper_.y0).cwiseAbs().maxCoeff();
    const double rest = watch.kind == Watch::Kind::slip ? rest_speed * (1.0 + speed) : 0.0;  // it has just begun
    for (int k = 1; k <= location_grid; ++k) {
        g[k] = margin_at(k * apart);
        if (g[k] < 0.0 && k == 1 && g[0] <= rest) return root_after_start(apart, g[1], margin_at);
        if (g[k] < 0.0) return root_between((k - 1) * apart, g[k - 1], k * apart, g[k], margin_at);
        if (k == 1 || g[k - 1] > g[k - 2] || g[k - 1] > g[k]) continue;
        if (g[k - 1] > parabola_part * (g[k - 2] - 2.0 * g[k - 1] + g[k])) continue;
        double value = 0.0;
        const double dip = dip_between((k - 2) * apart, k * apart, margin_at, value);
        if (value < 0.0) return root_between((k - 2) * apart, g[k - 2], dip, value, margin_at);
    }
    return beyond;
}

void EventLocator::end_step_at(double size) {
    stepper_.take(stepper_.t0, size);
    system_.project_and_evaluate(stepper_.t0 + size, stepper_.y1, stepper_.end_rate());
}

// Rate of a margin at the end of the step of this size: known for slip along one direction, else by a step a little
// shorter.
double EventLocator::margin_rate(const Watch& watch, double size, double here, double full) {
    if (known_rate(watch)) return slip_rate_along_mode(p, w, watch.index);
    const double shorter = std::max(0.0, size - std::max(difference_part * full, least_difference));
    if (!(shorter < size)) return 0.0;
    end_step_at(shorter);
    return (here - margin_at_end(watch)) / (size - shorter);
}

bool EventLocator::known_rate(const Watch& watch) const {
    return watch.kind == Watch::Kind::slip && p.frictions[watch.index].dim == 1;
}

// Takes the step again up to the event, and corrects the instant by what the margin is there.
void EventLocator::step_onto(const Watch& watch, double part) {
    const double full = stepper_.h, begin = stepper_.t0;
    double size = std::clamp(part, 0.0, 1.0) * full, size_before = 0.0, margin_before = 0.0;
    for (int it = 0; it < correction_passes; ++it) {
        end_step_at(size);
        const double here = margin_at_end(watch);
        double rate = 0.0;
        if (it == 0 || known_rate(watch)) rate = margin_rate(watch, size, here, full);
        else if (size != size_before) rate = (here - margin_before) / (size - size_before);
        size_before = size;
        margin_before = here;
        if (!(std::abs(rate) > 0.0)) break;
        const double next = std::clamp(size - here / rate, 0.0, full);
        if (std::abs(next - size) <= time_rounding * std::max(std::abs(begin), full) || next == size) break;
        if (it > sure_passes && std::abs(next - size) < corrected_width * full) break;
        size = next;
    }
    if (stepper_.h != size) end_step_at(size);
}

// Slip of several directions may turn far without coming to rest. It has come to rest when hardly anything is left of
// the slip that the step began with.
bool EventLocator::passes_by_rest(int e) const {
    if (p.frictions[e].dim == 1) return false;
    const double speed = system_.velocity(stepper_.y1).cwiseAbs().maxCoeff();
    const double slip = slip_velocity(w.now, p.frictions[e]).norm();
    return slip > rest_part * slip_at_start_[e] && slip > passing_speed * (1.0 + speed);
}

std::optional<FoundEvent> EventLocator::locate() {
    const auto found = [&](EventKind kind, int index) {
        return FoundEvent{kind, index, stepper_.t0 + stepper_.h};
    };
    for (int e = system_.ne - 1; e >= 0; --e)
        if (has_arrived(e)) return found(EventKind::rest_or_limit, e);
    const std::vector<Watch> watches = crossed();
    if (watches.empty()) return release_together();
    stepper_.make_interpolant();
    double first = beyond;
    const Watch* earliest = nullptr;
    for (const Watch& watch : watches) {
        const double part = first_crossing(watch);
        if (!(part < first)) continue;
        first = part;
        earliest = &watch;
    }
    if (!earliest) {  // what may have crossed did not
        system_.read(stepper_.y1);
        system_.read_law_states(stepper_.y1);
        evaluate(p, w, stepper_.t0 + stepper_.h, system_.q, system_.v);
        return std::nullopt;
    }
    step_onto(*earliest, first);
    if (earliest->kind == Watch::Kind::contact) return found(EventKind::pull, earliest->index);
    const bool reverses = earliest->kind == Watch::Kind::slip && passes_by_rest(earliest->index);
    if (const auto released = release_together()) return released;  // which may come earlier
    return found(reverses ? EventKind::reversal : EventKind::rest_or_limit, earliest->index);
}

// Whether all elements at rest at the step's end that stuck before it can stick on.
bool EventLocator::can_hold(const std::vector<Mode>& modes, ModeQuestion& asked) {
    const double t = stepper_.t0 + stepper_.h;
    system_.read(stepper_.y1);
    asked = {modes, {}, {}};
    for (int e = 0; e < system_.ne; ++e)
        if (at_rest(p, w, e, system_.v)) asked.at_rest.push_back(e);
    resolve_modes(p, w, t, system_.q, system_.v, asked);
    const bool all_stick = std::all_of(asked.at_rest.begin(), asked.at_rest.end(), [&](int e) {
        return w.state.mode[e] == sticking || modes[e] != sticking;
    });
    set_modes(p, w, modes);
    begin_step(p, w, t, system_.q, system_.v);
    return all_stick;
}

// Where redundant elements stick together, the multiplier of one says little: they hold as long as some forces within
// all limits do, those of elements included that slip but do not move. Halves the step down to the instant at which
// none do.
std::optional<FoundEvent> EventLocator::release_together() {
    if (!w.state.indeterminate) return std::nullopt;
    const double full = stepper_.h;
    const std::vector<Mode> modes = w.state.mode;
    ModeQuestion asked;
    if (can_hold(modes, asked)) return std::nullopt;
    double low = 0.0, high = full;
    while (high - low > release_width * std::max(std::abs(stepper_.t0), full)) {
        const double mid = 0.5 * (low + high);
        end_step_at(mid);
        (can_hold(modes, asked) ? low : high) = mid;
    }
    end_step_at(high);
    return FoundEvent{EventKind::released_together, asked.at_rest.front(), stepper_.t0 + high};
}

}  // namespace pn
