#include "run/events/gap_search.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "math/roots.hpp"

namespace pn {

GapSearch::GapSearch(System& system, Stepper& stepper, GapWatch& watch)
    : system_(system), stepper_(stepper), p(system.p), w(system.w), watch_(watch), start_(watch.gaps),
      curvature_(system.p), speed_(VecX::Zero(system.nv)), acceleration_(speed_), probe_(VecX::Zero(system.ny)) {}

// Bound |v| and |a| of each dof over the step, from the rates at the stages.
void GapSearch::bound_rates() {
    const int nq = system_.nq, nv = system_.nv;
    acceleration_.setZero();
    for (const Stepper::RateSample& sample : stepper_.rate_samples())
        acceleration_ = acceleration_.cwiseMax(sample.rate->segment(nq, nv).cwiseAbs());
    const double *v0 = stepper_.y0.data() + nq, *v1 = stepper_.y1.data() + nq;
    for (int k = 0; k < nv; ++k) {
        acceleration_[k] *= parameters.between_stages;
        // The speed exceeds the mean of both ends by at most half a step of acceleration.
        speed_[k] = 0.5 * (std::abs(v0[k]) + std::abs(v1[k])) + 0.5 * stepper_.h * acceleration_[k];
    }
}

// Return bounds of the second derivative of a gap between the step's ends. For a user's gap the bounds are estimates:
// multiples of the second derivatives of the cubic between the ends, and of the acceleration at the end.
GapSearch::Bends GapSearch::bends(int gap, const GapSample& end) const {
    if (CurvatureBounds::has_bounds(p, gap)) return {curvature_.lower_bound(w, gap), curvature_.upper_bound(w, gap)};
    const double h = stepper_.h, change = (end.width - start_.width[gap]) / h;
    const double r0 = start_.rate[gap], r1 = end.rate;
    const double most = parameters.between_stages * std::max({std::abs(6.0 * change - 4.0 * r0 - 2.0 * r1) / h,
                                                   std::abs(6.0 * change - 2.0 * r0 - 4.0 * r1) / h,
                                                   std::abs(gap_acceleration(p, w, gap))});
    return {most, most};
}

// Sample gaps at the step's start that the steps before have skipped.
void GapSearch::sample_starts(const std::vector<int>& gaps) {
    system_.read(stepper_.y0);
    kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
    for (int gap : gaps) {
        follow_gap(p, w, stepper_.t0, system_.v, gap);
        start_.keep(gap, GapSample::here(p, w, gap, 0.0));
    }
    system_.read(stepper_.y1);
    kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
}

const std::vector<GapSearch::Candidate>& GapSearch::find_candidates() {
    candidates_.clear();
    bound_rates();
    const std::vector<int>& unsampled = watch_.follow(speed_, stepper_.h);
    system_.read(stepper_.y1);
    if (!unsampled.empty()) sample_starts(unsampled);
    if (start_.monitored_gaps.empty()) return candidates_;
    rounding_ = parameters.width_rounding * scene_size(p, w);
    curvature_.bound_bodies(w, speed_, acceleration_, stepper_.h);
    closed_round_.clear();
    for (int i : w.now.closed_gaps)
        if (Separation::has(p, i)) closed_round_.push_back(i);
    for (int i : start_.monitored_gaps) {
        follow_gap(p, w, stepper_.t0 + stepper_.h, system_.v, i);
        watch_.end.push_back(GapSample::here(p, w, i, 1.0));
        if (start_.monitored[i] == GapState::from_step_end ||
            parameters.travel_factor * curvature_.max_change(i) < start_.width[i])
            continue;
        if (has_closed_copy(i)) continue;
        const GapSample end = above(watch_.end.back(), level_here(i, 1.0));
        const Bends bent = bends(i, end);
        if (!stays_open(i, sample_at_start(i), end, bent.below)) candidates_.push_back({i, end, bent});
    }
    return candidates_;
}

// Check if a gap stays open between two samples. The two parabolas of the bound through both samples lie below the gap.
// The gap is open if the larger of them is positive at its lowest point.
bool GapSearch::stays_open(int gap, const GapSample& a, const GapSample& b, double bound) const {
    const double length = (b.part - a.part) * stepper_.h, min_width = -rounding_;
    if (!(a.width > min_width) || !(b.width > min_width)) return false;
    if (a.separation) {
        const Kind& kind = p.blocks[p.gaps[gap].block].kind;
        return stays_apart(kind, *a.separation, *b.separation, bound, curvature_.speed(gap), length, min_width);
    }
    if (has_lowest_point(p, gap)) return stays_above(a.width, b.width, 0.5 * bound * length * length, min_width);
    const double change = b.rate - a.rate + bound * length;  // negative: no valid bound
    if (change <= 0.0) return change >= -parameters.rate_rounding * (std::abs(a.rate) + std::abs(b.rate));
    const double meet = (a.width - b.width + b.rate * length + 0.5 * bound * length * length) / change;
    if (!(meet > 0.0 && meet < length)) return true;
    return a.width + meet * (a.rate - 0.5 * bound * meet) > min_width;
}

// Check if a duplicate of the gap is closed. The gap follows the duplicate.
bool GapSearch::has_closed_copy(int gap) const {
    const std::vector<int>& closed_gaps = w.now.closed_gaps;
    return std::any_of(closed_gaps.begin(), closed_gaps.end(), [&](int closed) { return are_duplicates(p, closed, gap); });
}

bool GapSearch::slides_on(int gap) const {
    return std::any_of(closed_round_.begin(), closed_round_.end(), [&](int closed) { return same_bodies(p, gap, closed); });
}

GapSample GapSearch::above(GapSample sample, double level) const {
    sample.width -= level;
    if (sample.separation) sample.separation->radius += level;
    return sample;
}

double GapSearch::level_here(int gap, double part) const {
    double level = plane(gap);
    if (!Separation::has(p, gap)) return level;
    for (int closed : closed_round_) {
        if (!same_bodies(p, gap, closed)) continue;
        measure_gap(p, w, stepper_.t0 + part * stepper_.h, system_.v, closed);
        level = std::min(level, gap_width(p, w, closed));
    }
    return level;
}

GapSample GapSearch::sample_at_start(int gap) const {
    const GapSample out{0.0, start_.width[gap], start_.rate[gap], std::nullopt};
    if (!Separation::has(p, gap)) return above(out, plane(gap));
    double level = plane(gap);
    for (int held : closed_round_)
        if (same_bodies(p, gap, held)) level = std::min(level, start_.width[held]);
    return above({0.0, start_.width[gap], start_.rate[gap], start_.separation_of(gap)}, level);
}

GapSample GapSearch::sample(int gap, double part) {
    ++samples_;
    if (part == 0.0) return sample_at_start(gap);
    stepper_.interpolate(part, probe_);
    system_.read(probe_);
    kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
    follow_gap(p, w, stepper_.t0 + part * stepper_.h, system_.v, gap);
    const GapSample out = GapSample::here(p, w, gap, part);
    return above(out, level_here(gap, part));
}

// Return the instant at which a gap closes, between a sample without penetration and a sample with penetration.
GapSearch::Touch GapSearch::between(int gap, const GapSample& a, const GapSample& b) {
    const double part =
        root_between(a.part, a.width, b.part, b.width, [&](double at) { return sample(gap, at).width; });
    return {part, sample(gap, part).rate * stepper_.h};
}

std::optional<GapSearch::Touch> GapSearch::search(int gap, const GapSample& a, const GapSample& b, const Bends& bends) {
    const double bound = bends.below;
    // A touching gap that the solver left open stays on its plane. Such a gap touches again if it penetrates.
    const bool rests = stepper_.t0 < start_.retry_time[gap];
    if (rests && std::abs(a.width) <= rounding_ && std::abs(b.width) <= rounding_) return std::nullopt;
    if (stays_open(gap, a, b, bound)) return std::nullopt;
    const double length = (b.part - a.part) * stepper_.h;
    // The gap closes monotonically.
    if (b.width < -rounding_ && a.rate + bends.above * length < 0.0) return between(gap, a, b);
    if (bends.above * length * length < rounding_ || samples_ > parameters.max_samples) {
        // Bodies can slide to the next contact point, as a corner from a face onto an edge. The gap of that point then
        // falls to zero and stays zero. The gap does not touch before it becomes negative.
        const bool has_closed = samples_ > parameters.max_samples && !rests && !(a.separation && slides_on(gap));
        if (a.width > 0.0 && b.width < -rounding_) return between(gap, a, b);
        if (b.width < -rounding_ || has_closed) return Touch{b.part, b.rate * stepper_.h};
        return std::nullopt;
    }
    // A gap that leaves its plane stays open until rate / bound, with the bound on its second derivative: the parabola
    // of this curvature closes at twice this time.
    if (a.width <= rounding_ && a.rate > 0.0 && !a.separation && !has_lowest_point(p, gap)) {
        const double open_until = a.part + a.rate / (bound * stepper_.h);
        if (open_until < 0.5 * (a.part + b.part) && open_until > a.part) {
            const GapSample up = sample(gap, open_until);
            if (up.width > 0.0) return search(gap, up, b, bends);
        }
    }
    const GapSample middle = sample(gap, 0.5 * (a.part + b.part));
    if (const auto touch = search(gap, a, middle, bends)) return touch;
    return search(gap, middle, b, bends);
}

// Check if a gap stays on its plane over the step, as the gap of a feature that lies beside the touching one.
bool GapSearch::stays_on_plane(int gap, const GapSample& a, const GapSample& b) {
    if (std::abs(a.width) > rounding_ || std::abs(b.width) > rounding_) return false;
    for (double part : parameters.plane_parts)
        if (std::abs(sample(gap, part).width) > rounding_) return false;
    return true;
}

std::optional<GapSearch::Touch> GapSearch::first_touch(int gap) {
    samples_ = 0;
    stepper_.make_interpolant();
    const auto is_of_gap = [&](const Candidate& candidate) { return candidate.gap == gap; };
    const auto candidate = std::find_if(candidates_.begin(), candidates_.end(), is_of_gap);
    const GapSample start = sample_at_start(gap);
    if (stays_on_plane(gap, start, candidate->end)) samples_ = parameters.max_samples + 1;
    return search(gap, start, candidate->end, candidate->bends);
}

}  // namespace pn
