#include "run/events/event_search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/active_set.hpp"
#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/roots.hpp"

namespace pn {

namespace {

// --- What may have happened in a step. Speeds [rad/s or m/s] grow with the largest of the scene, as 1 + speed.
// Part of a limit by which rounding may pass it: of a force that stands still, and of the share that stages see.
constexpr double limit_rounding = 1e-12, share_rounding = 1e-9;
// What a parabola through the shares at three stages rises above them counts so often, and their range by this part: the
// share itself may go further between the stages.
constexpr double times_parabola = 3.0, range_between = 0.02;
// Part of the speed of rest by which an element that has just begun to slip may lie on the other side.
constexpr double fresh_slip = 1e-3;
// A least speed between two stages counts as a dip below zero where it is below this part of the speeds' range: the
// cubics through the stages miss the motion by less.
constexpr double dip_part = 0.02;

// --- The interpolant
constexpr int location_grid = 24;  // points of a step at which a margin is looked at first
constexpr double apart = 1.0 / location_grid;
constexpr double beyond = 2.0;     // part of a step: none of it
// A parabola through three points lies lower than the middle one by an eighth of its second difference at most; twice
// that is looked into.
constexpr double parabola_part = 0.25;
// A margin that is so far below zero, in parts of that at the step's start, where it should be zero has leapt there; and
// parts of a time that tell an instant from the next.
constexpr double leap_part = 1e-3, leap_digits = 1e-15;
constexpr double slope_part = 1e-4;  // of the step, over which the rate of a margin is a difference
constexpr double doubted_part = 1e-2;  // of the change of a share, to which an interpolant of low order tells it
// What the shares' rates tell is confirmed in so many evaluations, until a correction is this part of the step: what is
// left is the square of it, and the step taken again corrects that.
constexpr int confirmations = 3;
constexpr double confirmed_width = 1e-4;
// A margin leaps where the shares' rates say that it is gone and more than this part of it is left. The polynomial through
// rates before a leap and behind it falls so steeply that a correction by its slope is tiny wherever the leap lies.
constexpr double left_part = 0.1;

}  // namespace

EventSearch::EventSearch(System& system, Stepper& stepper, const std::vector<char>& pulls, GapWatch& watch)
    : system_(system), stepper_(stepper), p(system.p), w(system.w), pulls_(pulls),
      gaps_(system, stepper, watch), probe_(VecX::Zero(system.ny)),
      probe_rate_(probe_) {}

double EventSearch::margin(const Watch& watch, double t, const VecX& y) {
    if (watch.kind == Watch::Kind::contact) return contact_press(p, w, watch.index).margin;
    if (watch.kind == Watch::Kind::load) return w.now.lam[p.blocks[p.gaps[watch.index].block].row];
    if (watch.kind == Watch::Kind::gap) {
        system_.read(y);
        evaluate_gap(p, w, t, system_.v, watch.index);
        return gap_width(p, w, watch.index) - gaps_.plane(watch.index);
    }
    if (watch.kind == Watch::Kind::slip) return slip_along_mode(p, w, watch.index) + allowance(watch.index);
    system_.read(y);
    const HoldingForce held = holding_force(p, w, watch.index, t, system_.q, system_.v);
    return held.limit * (1.0 + limit_rounding) - held.force.norm();
}

// --- What may have crossed ------------------------------------------------------------------------------------------

double EventSearch::noise() const {
    return fresh_slip * rest_speed * (1.0 + system_.velocity(stepper_.y1).cwiseAbs().maxCoeff());
}

// By how much what lingers at rest may go against its mode.
double EventSearch::allowance(int e) const {
    return w.state.lingers[e] ? raised_rest * (1.0 + system_.velocity(stepper_.y0).cwiseAbs().maxCoeff()) : 0.0;
}

// Whether what sticks is past its limit at the step's end, or may have been inside, between two stages.
bool EventSearch::may_reach_limit(int e) {
    const std::vector<Stepper::Look>& looks = stepper_.looks();
    const auto share = [&](size_t k) { return system_.share(*looks[k].rate, e); };
    double least = share(0), most = least, rise = 0.0;
    for (size_t k = 1; k < looks.size(); ++k) {
        least = std::min(least, share(k));
        most = std::max(most, share(k));
    }
    const double range = most - least;
    if (range <= share_rounding) return most > 1.0 + share_rounding || least < -1.0 - share_rounding;
    for (size_t k = 2; k < looks.size(); ++k) {
        const double t0 = looks[k - 2].part, t1 = looks[k - 1].part, t2 = looks[k].part;
        rise = std::max({rise, rise_between(t0, share(k - 2), t1, share(k - 1), t2, share(k)),
                         rise_between(t0, -share(k - 2), t1, -share(k - 1), t2, -share(k))});
    }
    return std::max(most, -least) + times_parabola * rise + range_between * range > 1.0 + limit_rounding;
}

// Whether what slips goes the other way at the step's end, or may have done so inside.
bool EventSearch::may_stop(int e) const { return slip_along_mode(p, w, e) + allowance(e) < -noise() || dips(e); }

// A dip through zero and back. Speeds and their rates are known at the stages and at both ends: cubics through them
// tell where one may have been below zero in between.
bool EventSearch::dips(int e) const {
    if (stepper_.method.order < 2) return false;
    const std::vector<Stepper::Look>& looks = stepper_.looks();
    const double allowed = allowance(e), below_rest = -noise();
    const auto speed = [&](size_t k) { return system_.slip(*looks[k].rate, e) + allowed; };
    double least = HUGE_VAL, most = -HUGE_VAL;
    bool below = false;
    for (size_t k = 0; k < looks.size(); ++k) {
        least = std::min(least, speed(k));
        most = std::max(most, speed(k));
        below |= k > 0 && k + 1 < looks.size() && speed(k) < below_rest;
    }
    if (below) return true;
    if (most <= allowed - below_rest) return false;  // held by what sticks, it never left rest
    const double dip = dip_part * (most - least);
    for (size_t k = 0; k + 1 < looks.size(); ++k) {
        const double length = (looks[k + 1].part - looks[k].part) * stepper_.h;
        const double from = speed(k), to = speed(k + 1), leaves = length * system_.slip_rate(*looks[k].rate, e),
                     comes = length * system_.slip_rate(*looks[k + 1].rate, e);
        if (lower_bound_inside(from, leaves, to, comes) < dip && least_inside(from, leaves, to, comes) < dip) return true;
    }
    return false;
}

// Contacts that begin to pull: one of those that share a load, where none of them pulls yet.
void EventSearch::add_pulls(std::vector<Watch>& list) {
    const auto may_pull = [&](int i) { return !pulls_[i] && normal_force(p, w, i) < 0.0; };
    const int n = static_cast<int>(p.contacts.size());
    int first = 0;
    while (first < n && !may_pull(first)) ++first;
    if (first == n) return;
    std::vector<char> told = pulls_;
    for (int i = first; i < n; ++i) {
        if (told[i] || !may_pull(i)) continue;
        const Press found = contact_press(p, w, i);
        if (found.must_pull && std::none_of(found.sharing.begin(), found.sharing.end(), [&](int j) { return told[j]; }))
            list.push_back({Watch::Kind::contact, i});
        for (int j : found.sharing) told[j] = 1;
    }
}

// Whether the normal force of a closed contact pulls at the step's end, or may have done so inside, between two stages.
bool EventSearch::may_pull(int gap) {
    const std::vector<Stepper::Look>& looks = stepper_.looks();
    const auto load = [&](size_t k) { return system_.load(*looks[k].rate, gap); };
    double least = load(0), most = least, fall = 0.0;
    for (size_t k = 1; k < looks.size(); ++k) {
        least = std::min(least, load(k));
        most = std::max(most, load(k));
    }
    for (size_t k = 2; k < looks.size(); ++k)
        fall = std::max(fall, rise_between(looks[k - 2].part, -load(k - 2), looks[k - 1].part, -load(k - 1),
                                           looks[k].part, -load(k)));
    return least - times_parabola * fall - range_between * (most - least) < -load_rounding(p, w, gap);
}

// What lies past its event at the step's end (the workspace is evaluated there), or may have crossed inside.
std::vector<Watch> EventSearch::crossed() {
    std::vector<Watch> list;
    if (stepper_.method.order > 1) add_pulls(list);
    for (int e : w.now.loaded) {
        if (w.state.mode[e] != sticking) {
            if (may_stop(e)) list.push_back({Watch::Kind::slip, e});
        } else if (!w.state.indeterminate && may_reach_limit(e)) {
            list.push_back({Watch::Kind::stick, e});
        }
    }
    if (p.gaps.empty()) return list;
    if (!w.now.rows.redundant)  // those are asked together
        for (int i : w.now.touching)
            if (!is_bare(p, i) && may_pull(i)) list.push_back({Watch::Kind::load, i});
    for (const GapSearch::Doubt& doubt : gaps_.doubtful()) list.push_back({Watch::Kind::gap, doubt.gap});
    return list;
}

// Of the gaps that were in doubt over the step.
std::optional<Crossing> EventSearch::entered(const Watch& touches) {
    std::optional<Crossing> out;
    if (gaps_.doubted().empty()) return out;
    double least = -touching_width * scene_size(p, w);
    for (const GapSearch::Doubt& doubt : gaps_.doubted()) {
        const Watch watch{Watch::Kind::gap, doubt.gap};
        if (touches.kind == watch.kind && touches.index == watch.index) continue;
        const double deep = margin(watch, stepper_.t0 + stepper_.h, stepper_.y1);
        if (!(deep < least)) continue;
        least = deep;
        out = Crossing{watch, 1.0, gap_rate(p, w, doubt.gap) * stepper_.h};
    }
    return out;
}

// --- Where it crosses -----------------------------------------------------------------------------------------------

bool EventSearch::integrates() const { return stepper_.method.order > 1 && !stepper_.method.outside(); }

EventSearch::Source EventSearch::source(const Watch& watch) const {
    if (watch.kind == Watch::Kind::contact) return Source::evaluation;
    if (watch.kind == Watch::Kind::gap) return Source::kinematics;
    if (watch.kind == Watch::Kind::load) return integrates() ? Source::shares : Source::evaluation;
    if (watch.kind == Watch::Kind::stick) return integrates() ? Source::shares : Source::evaluation;
    return p.blocks[p.frictions[watch.index].block].dof >= 0 ? Source::velocities : Source::kinematics;
}

double EventSearch::interpolated_share(int e, double part) const {
    return stepper_.interpolated_rate(part, system_.ns + 2 * e);
}

// How far the interpolated share of what sticks may be off: by what the further stages of the interpolant show, which
// are as good as itself; without them by what the others show, and by a part of the share's change.
double EventSearch::share_error(int e) const {
    const Method& method = stepper_.method;
    const bool further = method.further_stages > 0;
    double error = 0.0;
    if (stepper_.collocates()) {  // its polynomial misses the rates at the step's ends alone
        for (const Stepper::Look& look : stepper_.looks())
            error = std::max(error, std::abs(interpolated_share(e, look.part) - system_.share(*look.rate, e)));
        return error;
    }
    if (!further)
        for (const Stepper::Look& look : stepper_.looks())
            error = std::max(error, doubted_part * std::abs(system_.share(*look.rate, e) -
                                                            system_.share(stepper_.rates[0], e)));
    for (int k = further ? 0 : 1; k < (further ? method.further_stages : method.stages); ++k) {
        const double part = further ? method.C_further[k] : method.C[k];
        const VecX& rate = stepper_.rates[further ? method.stages + 1 + k : k];
        error = std::max(error, std::abs(interpolated_share(e, part) - system_.share(rate, e)));
    }
    return error;
}

double EventSearch::margin_inside(const Watch& watch, Source source, double part) {
    const bool of_element = watch.kind == Watch::Kind::slip || watch.kind == Watch::Kind::stick;
    const Friction* f = of_element ? &p.frictions[watch.index] : nullptr;
    if (source == Source::shares && !of_element)
        return stepper_.interpolated_rate(part, system_.ns + 2 * system_.ne + watch.index);
    if (source == Source::shares) {
        return 1.0 + limit_rounding - doubt_ - std::abs(interpolated_share(watch.index, part));
    }
    if (source == Source::velocities) {
        const int first = system_.nq + p.blocks[f->block].dof;
        double along = allowance(watch.index);
        if (f->dim == 1) return along + w.state.mode[watch.index] * stepper_.interpolated(part, first);
        for (int k = 0; k < f->dim; ++k)
            along += w.state.slip_direction[watch.index][k] * stepper_.interpolated(part, first + k);
        return along;
    }
    const double t = stepper_.t0 + part * stepper_.h;
    stepper_.interpolate(part, probe_);
    if (source == Source::evaluation) {
        system_.derivative(t, probe_, probe_rate_);
    } else {
        system_.read(probe_);
        update_kinematics(p, w, t, system_.q, system_.v);
    }
    return margin(watch, t, probe_);
}

// Whether slip falls by more than a speed of rest over the step, at the rate that it starts with.
bool EventSearch::slows_down(int e, double rest) const {
    return stepper_.h * system_.slip_rate(stepper_.start_rate(), e) < -rest;
}

// Part of the step at which a watched margin first falls below zero, on a grid and between its points; beyond the step
// where it does not.
double EventSearch::first_crossing(const Watch& watch, Source source) {
    const auto margin_at = [&](double part) { return margin_inside(watch, source, part); };
    double g[location_grid + 1];
    g[0] = margin_at(0.0);
    const double speed = system_.velocity(stepper_.y0).cwiseAbs().maxCoeff();
    const bool slips = watch.kind == Watch::Kind::slip;
    const double rest = slips ? rest_speed * (1.0 + speed) : 0.0;
    bool begins = g[0] <= rest;
    for (int k = 1; k <= location_grid; ++k) {
        g[k] = margin_at(k * apart);
        if (begins && g[k] < 0.0) {
            // Slip of several directions that has just begun may first turn into its own; it has come to rest again
            // where it rose before. What slows down did not begin: it came to rest just as the step before ended.
            const bool turns = slips && p.frictions[watch.index].dim > 1 && !slows_down(watch.index, rest);
            const double part = k > 1 ? 0.0 : root_after_start(apart, g[1], turns ? rest : 0.0, margin_at);
            if (part > 0.0 || !turns) return part;
            continue;
        }
        begins = false;
        if (g[k] < 0.0) return root_between((k - 1) * apart, g[k - 1], k * apart, g[k], margin_at);
        if (k == 1 || g[k - 1] > g[k - 2] || g[k - 1] > g[k]) continue;
        if (g[k - 1] > parabola_part * (g[k - 2] - 2.0 * g[k - 1] + g[k])) continue;
        double value = 0.0;
        const double dip = dip_between((k - 2) * apart, k * apart, margin_at, value);
        if (value < 0.0) return root_between((k - 2) * apart, g[k - 2], dip, value, margin_at);
    }
    return beyond;
}

// Newton's method on the motion that the interpolant gives, from where the shares' rates say that a limit was reached;
// nothing where it does not converge, or where the margin there is still near what it was as the step began: it leaps.
std::optional<double> EventSearch::confirm(const Watch& watch, double part, double slope, double at_start) {
    for (int it = 0; it < confirmations && slope < 0.0; ++it) {
        const double here = margin_inside(watch, Source::evaluation, part);
        if (!(std::abs(here) < left_part * std::abs(at_start))) break;
        const double next = part - here / slope;
        if (!(next >= 0.0 && next <= 1.0)) break;
        const double change = std::abs(next - part);
        part = next;
        if (change < confirmed_width) return part;
    }
    return std::nullopt;
}

// What a contact carries falls below zero in one leap where its place changes: a corner that comes to an edge flies off.
// The event is behind it, by digits of the time that tell it from the instant before.
std::optional<Crossing> EventSearch::behind_leap(const Watch& watch, Source from, double part) {
    if (!(margin_inside(watch, from, part) < -leap_part * margin_inside(watch, from, 0.0))) return std::nullopt;
    part = std::max(part, leap_digits * (std::abs(stepper_.t0) + stepper_.h) / stepper_.h);
    for (; part < 1.0; part *= 2.0)
        if (margin_inside(watch, from, part) < 0.0) return Crossing{watch, part, 0.0, true};
    return std::nullopt;
}

Crossing EventSearch::cross(const Watch& watch, Source from) {
    if (watch.kind == Watch::Kind::gap) {
        const auto touch = gaps_.first_touch(watch.index);
        return touch ? Crossing{watch, touch->part, touch->slope} : Crossing{watch, beyond, 0.0};
    }
    if (from == Source::shares && watch.kind == Watch::Kind::stick) doubt_ = share_error(watch.index);
    const double part = first_crossing(watch, from);
    if (part == beyond) return {watch, part, 0.0};
    if (watch.kind == Watch::Kind::load)
        if (const auto crossing = behind_leap(watch, from, part)) return *crossing;
    const double before = std::max(0.0, part - slope_part), after = before + slope_part;
    return {watch, part, (margin_inside(watch, from, after) - margin_inside(watch, from, before)) / slope_part};
}

// The crossing that the shares' rates tell, as the motion on the interpolant has it.
Crossing EventSearch::confirmed(const Crossing& told) {
    system_.read(stepper_.y1);
    if (told.watch.kind == Watch::Kind::load) {
        const auto part = confirm(told.watch, told.part, told.slope, system_.load(stepper_.start_rate(), told.watch.index));
        return part ? Crossing{told.watch, *part, told.slope} : cross(told.watch, Source::evaluation);
    }
    const double limit = static_limits(p, w, told.watch.index, stepper_.t0 + stepper_.h, system_.q, system_.v).reach();
    const double at_start = limit * (1.0 - std::abs(system_.share(stepper_.start_rate(), told.watch.index)));
    const auto part = confirm(told.watch, told.part, told.slope * limit, at_start);
    return part ? Crossing{told.watch, *part, told.slope * limit} : cross(told.watch, Source::evaluation);
}

std::optional<Crossing> EventSearch::first() {
    const std::vector<Watch> watches = crossed();
    if (watches.empty()) return std::nullopt;
    stepper_.make_interpolant();
    std::vector<std::pair<Crossing, bool>> list;  // and whether it is sure
    for (const Watch& watch : watches) {
        const Source from = source(watch);
        list.emplace_back(cross(watch, from), from != Source::shares);
    }
    for (;;) {
        auto& [earliest, sure] = *std::min_element(list.begin(), list.end(), [](const auto& one, const auto& other) {
            return one.first.part < other.first.part;
        });
        if (earliest.part == beyond) break;
        if (sure) return earliest;
        earliest = confirmed(earliest);
        sure = true;
    }
    stepper_.end_directions();
    system_.read(stepper_.y1);
    system_.read_law_states(stepper_.y1);
    evaluate(p, w, stepper_.t0 + stepper_.h, system_.q, system_.v);
    return std::nullopt;
}

}  // namespace pn
