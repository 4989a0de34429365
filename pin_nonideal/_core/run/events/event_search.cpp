#include "run/events/event_search.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/roots.hpp"
#include "math/tolerances.hpp"

namespace pn {

EventSearch::EventSearch(System& system, Stepper& stepper, const std::vector<char>& pulls, GapWatch& watch)
    : system_(system), stepper_(stepper), p(system.p), w(system.w), gaps_(system, stepper, watch),
      candidates_(system, stepper, pulls, gaps_), probe_(VecX::Zero(system.ny)), probe_rate_(probe_) {}

double EventSearch::margin(const Watch& watch, double t, const VecX& y) {
    if (watch.kind == Watch::Kind::contact) return contact_pull_margin(p, w, watch.index).margin;
    if (watch.kind == Watch::Kind::load) return w.now.lam[p.blocks[p.gaps[watch.index].block].row];
    if (watch.kind == Watch::Kind::gap) {
        system_.read(y);
        evaluate_gap(p, w, t, system_.v, watch.index);
        return gap_width(p, w, watch.index) - gaps_.plane(watch.index);
    }
    if (watch.kind == Watch::Kind::slip) return slip_along_mode(p, w, watch.index) + candidates_.allowance(watch.index);
    system_.read(y);
    const HoldingForce held = holding_force(p, w, watch.index, t, system_.q, system_.v);
    return held.limit * (1.0 + EventCandidates::parameters.limit_rounding) - held.force.norm();
}

// Only candidate gaps of the step are checked.
std::optional<Crossing> EventSearch::deepest_penetration(const Watch& touches) {
    std::optional<Crossing> out;
    if (gaps_.candidates().empty()) return out;
    double lowest_width = -touching_width * scene_size(p, w);
    for (const GapSearch::Candidate& candidate : gaps_.candidates()) {
        const Watch watch{Watch::Kind::gap, candidate.gap};
        if (touches.kind == watch.kind && touches.index == watch.index) continue;
        const double width = margin(watch, stepper_.t0 + stepper_.h, stepper_.y1);
        if (!(width < lowest_width)) continue;
        lowest_width = width;
        out = Crossing{watch, 1.0, gap_rate(p, w, candidate.gap) * stepper_.h};
    }
    return out;
}

// --- Location of a crossing -----------------------------------------------------------------------------------------

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

// Return the error bound of the interpolated force / limit ratio of a sticking element. The bound comes from the further
// stages of the interpolant, which are as accurate as the interpolant. Without further stages, the other stages and a
// fraction of the ratio's change give the bound.
double EventSearch::share_error(int e) const {
    const Method& method = stepper_.method;
    const bool further = method.further_stages > 0;
    double error = 0.0;
    if (stepper_.collocates()) {  // its polynomial differs from the rates only at the step's ends
        for (const Stepper::RateSample& sample : stepper_.rate_samples())
            error = std::max(error, std::abs(interpolated_share(e, sample.part) - system_.share(*sample.rate, e)));
        return error;
    }
    if (!further)
        for (const Stepper::RateSample& sample : stepper_.rate_samples())
            error = std::max(error, parameters.doubted_part * std::abs(system_.share(*sample.rate, e) -
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
        return 1.0 + EventCandidates::parameters.limit_rounding - share_error_ -
               std::abs(interpolated_share(watch.index, part));
    }
    if (source == Source::velocities) {
        const int first = system_.nq + p.blocks[f->block].dof;
        double along = candidates_.allowance(watch.index);
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

// Check if slip falls by more than the speed of rest over the step, at the rate of the step's start.
bool EventSearch::slows_down(int e, double rest) const {
    return stepper_.h * system_.slip_rate(stepper_.start_rate(), e) < -rest;
}

// Return the fraction of the step at which a margin first falls below zero, searched on a grid and between its points.
// Return `no_crossing` if it does not.
double EventSearch::first_crossing(const Watch& watch, Source source) {
    const auto margin_at = [&](double part) { return margin_inside(watch, source, part); };
    double g[parameters.grid + 1];
    g[0] = margin_at(0.0);
    const double speed = system_.velocity(stepper_.y0).cwiseAbs().maxCoeff();
    const bool slips = watch.kind == Watch::Kind::slip;
    const double rest = slips ? rest_speed * (1.0 + speed) : 0.0;
    bool begins = g[0] <= rest;
    for (int k = 1; k <= parameters.grid; ++k) {
        g[k] = margin_at(k * parameters.spacing);
        if (begins && g[k] < 0.0) {
            // Slip in several directions that has just begun may first turn. The slip speed has fallen to rest again only if
            // the speed rose before. Slip that decreases from the start came to rest at the end of the last step.
            const bool turns = slips && p.frictions[watch.index].dim > 1 && !slows_down(watch.index, rest);
            const double part = k > 1 ? 0.0 : root_after_start(parameters.spacing, g[1], turns ? rest : 0.0, margin_at);
            if (part > 0.0 || !turns) return part;
            continue;
        }
        begins = false;
        if (g[k] < 0.0)
            return root_between((k - 1) * parameters.spacing, g[k - 1], k * parameters.spacing, g[k], margin_at);
        if (k == 1 || g[k - 1] > g[k - 2] || g[k - 1] > g[k]) continue;
        if (g[k - 1] > parameters.parabola_part * (g[k - 2] - 2.0 * g[k - 1] + g[k])) continue;
        double value = 0.0;
        const double dip = dip_between((k - 2) * parameters.spacing, k * parameters.spacing, margin_at, value);
        if (value < 0.0) return root_between((k - 2) * parameters.spacing, g[k - 2], dip, value, margin_at);
    }
    return no_crossing;
}

// Confirm a crossing by Newton's method on the interpolated motion, from the crossing of the interpolated rates. Return
// nothing if it does not converge. Return nothing either if the margin there is still near its value at the step's
// start, since the margin then jumps.
std::optional<double> EventSearch::confirm(const Watch& watch, double part, double slope, double at_start) {
    for (int it = 0; it < parameters.max_confirmations && slope < 0.0; ++it) {
        const double here = margin_inside(watch, Source::evaluation, part);
        if (!(std::abs(here) < parameters.left_part * std::abs(at_start))) break;
        const double next = part - here / slope;
        if (!(next >= 0.0 && next <= 1.0)) break;
        const double change = std::abs(next - part);
        part = next;
        if (change < parameters.confirmed_width) return part;
    }
    return std::nullopt;
}

// Return the crossing of a contact load that jumps below zero, as when a corner reaches an edge. The event lies after
// the jump, by the smallest time difference that separates two instants. Return nothing if the load does not jump.
std::optional<Crossing> EventSearch::cross_jump(const Watch& watch, Source from, double part) {
    if (!(margin_inside(watch, from, part) < -parameters.jump_part * margin_inside(watch, from, 0.0)))
        return std::nullopt;
    part = std::max(part, parameters.jump_digits * (std::abs(stepper_.t0) + stepper_.h) / stepper_.h);
    for (; part < 1.0; part *= 2.0)
        if (margin_inside(watch, from, part) < 0.0) return Crossing{watch, part, 0.0, true};
    return std::nullopt;
}

Crossing EventSearch::cross(const Watch& watch, Source from) {
    if (watch.kind == Watch::Kind::gap) {
        const auto touch = gaps_.first_touch(watch.index);
        return touch ? Crossing{watch, touch->part, touch->slope} : Crossing{watch, no_crossing, 0.0};
    }
    if (from == Source::shares && watch.kind == Watch::Kind::stick) share_error_ = share_error(watch.index);
    const double part = first_crossing(watch, from);
    if (part == no_crossing) return {watch, part, 0.0};
    if (watch.kind == Watch::Kind::load)
        if (const auto crossing = cross_jump(watch, from, part)) return *crossing;
    const double before = std::max(0.0, part - root_search_parameters.margin_slope_step),
                 after = before + root_search_parameters.margin_slope_step;
    return {watch, part,
            (margin_inside(watch, from, after) - margin_inside(watch, from, before)) /
                root_search_parameters.margin_slope_step};
}

// Confirm a crossing of the interpolated rates on the interpolated motion.
Crossing EventSearch::confirmed(const Crossing& interpolated) {
    const Watch& watch = interpolated.watch;
    system_.read(stepper_.y1);
    if (watch.kind == Watch::Kind::load) {
        const double at_start = system_.load(stepper_.start_rate(), watch.index);
        const auto part = confirm(watch, interpolated.part, interpolated.slope, at_start);
        return part ? Crossing{watch, *part, interpolated.slope} : cross(watch, Source::evaluation);
    }
    const double limit = static_limits(p, w, watch.index, stepper_.t0 + stepper_.h, system_.q, system_.v).reach();
    const double at_start = limit * (1.0 - std::abs(system_.share(stepper_.start_rate(), watch.index)));
    const double slope = interpolated.slope * limit;
    const auto part = confirm(watch, interpolated.part, slope, at_start);
    return part ? Crossing{watch, *part, slope} : cross(watch, Source::evaluation);
}

std::optional<Crossing> EventSearch::first(const std::vector<int>& arrived) {
    const std::vector<Watch> watches = candidates_.find(arrived);
    if (watches.empty()) return std::nullopt;
    stepper_.make_interpolant();
    std::vector<std::pair<Crossing, bool>> list;  // crossing, and whether it is confirmed
    for (const Watch& watch : watches) {
        const Source from = source(watch);
        list.emplace_back(cross(watch, from), from != Source::shares);
    }
    for (;;) {
        auto& [earliest, is_confirmed] = *std::min_element(list.begin(), list.end(), [](const auto& one, const auto& other) {
            return one.first.part < other.first.part;
        });
        if (earliest.part == no_crossing) break;
        if (is_confirmed) return earliest;
        earliest = confirmed(earliest);
        is_confirmed = true;
    }
    stepper_.end_directions();
    system_.read(stepper_.y1);
    system_.read_law_states(stepper_.y1);
    evaluate(p, w, stepper_.t0 + stepper_.h, system_.q, system_.v);
    return std::nullopt;
}

}  // namespace pn
