#include "run/events/gap_watch.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "math/bytes.hpp"

namespace pn {

GapWatch::GapWatch(System& system, GapState& state)
    : gaps(state), travel(system.p), system_(system), p(system.p), w(system.w) {
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (i == 0 || p.bodies_of_gap[i] != p.bodies_of_gap[i - 1]) first_of_group_.push_back(i);
        group_.push_back(static_cast<int>(first_of_group_.size()) - 1);
    }
    gaps = GapState(p.gaps.size(), first_of_group_.size());
    first_of_group_.push_back(static_cast<int>(p.gaps.size()));
    travel.size(gaps.travel);
}

void GapWatch::sample(double t, int gap) {
    follow_gap(p, w, t, system_.v, gap);
    gaps.keep(gap, GapSample::here(p, w, gap, 0.0));
}

void GapWatch::classify(int gap) {
    const TravelBound::Pair& pair = travel.pair(gap);
    gaps.monitored[gap] = 1;
    gaps.skipped[gap] = 0;
    if (pair.is_unknown) return;
    gaps.distance[gap] = pair.plane_rotates ? travel.distance(w.now.terms, gap) : 0.0;
    const double path_length = parameters.min_skipped_steps * travel.step_path_length(gaps.travel, gap);
    const double turn = parameters.min_skipped_steps * gaps.travel.turn_step[pair.second];
    if (!(gaps.width[gap] > TravelBound::max_change(pair, path_length, turn, gaps.distance[gap]))) return;
    gaps.monitored[gap] = 0;
    gaps.skipped[gap] = 1;
    gaps.path_length[gap] = travel.path_length(gaps.travel, gap);
    gaps.turn[gap] = gaps.travel.turn[pair.second];
    gaps.recheck_at(group_[gap], gaps.travel.scene + travel.min_scene_travel(pair, gaps.width[gap]));
}

void GapWatch::sample_all(double t) {
    followed = gaps.travel.placed = false;
    travel.sum_up(gaps.travel);
    gaps.current = true;
    gaps.recheck_all_at(HUGE_VAL);
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        gaps.monitored[i] = gaps.skipped[i] = 0;
        if (is_bare(p, i)) continue;
        gaps.width[i] = measured_width(p, w, t, system_.v, i);
        gaps.rate[i] = 0.0;
        if (!w.state.closed[i]) classify(i);
        if (gaps.skipped[i]) continue;
        follow_gap(p, w, t, system_.v, i);
        gaps.keep(i, GapSample::here(p, w, i, 0.0));
    }
    gaps.list_monitored();
}

void GapWatch::sample_monitored(double t) {
    if (!followed) return sample_all(t);
    followed = false;
    gaps.travel.add_step();
    for (int i : w.now.closed_gaps)
        if (Separation::has(p, i)) sample(t, i);
    for (size_t k = 0; k < gaps.monitored_gaps.size(); ++k) gaps.keep(gaps.monitored_gaps[k], end[k]);
    skip_wide();
}

void GapWatch::skip_wide() {
    const auto stays = [&](int i) { return !(gaps.width[i] > 0.0) && gaps.monitored[i] == 1; };
    if (std::all_of(gaps.monitored_gaps.begin(), gaps.monitored_gaps.end(), stays)) return;
    travel.sum_up(gaps.travel);
    bool leave = false;
    for (int i : gaps.monitored_gaps) {
        classify(i);
        leave |= gaps.skipped[i];
    }
    if (leave) gaps.list_monitored();
}

// Recheck the skipped gaps of all groups that are due.
void GapWatch::recheck_skipped() {
    const double ahead = gaps.travel.scene + parameters.steps_ahead * gaps.travel.scene_step;
    bool leave = false;
    for (int group = 0; group < static_cast<int>(gaps.group_recheck.size()); ++group)
        if (!(ahead < gaps.group_recheck[group])) leave |= recheck_group(group);
    gaps.recheck_travel = HUGE_VAL;
    for (double travel : gaps.group_recheck) gaps.recheck_travel = std::min(gaps.recheck_travel, travel);
    if (leave) gaps.list_monitored();
}

// Monitor the skipped gaps of a group whose bodies may have traveled half of the width. If a gap is proven open over the
// step, it is sampled at the step's end only. Other gaps are returned in `unsampled_`, for a sample at the step's start.
// Return true if any gap is monitored from now on.
bool GapWatch::recheck_group(int group) {
    const TravelState& here = gaps.travel;
    gaps.group_recheck[group] = HUGE_VAL;
    bool leave = false;
    for (int i = first_of_group_[group]; i < first_of_group_[group + 1]; ++i) {
        if (!gaps.skipped[i]) continue;
        const TravelBound::Pair& pair = travel.pair(i);
        const double path_length = travel.path_length(here, i),
                     traveled = path_length - gaps.path_length[i] + parameters.travel_rounding * path_length;
        const double turn = here.turn[pair.second], turned = turn - gaps.turn[i] + parameters.travel_rounding * turn;
        const auto is_open = [&](double times, double steps) {
            return gaps.width[i] > TravelBound::max_change(pair, times * traveled + steps * travel.step_path_length(here, i),
                                                    times * turned + steps * here.turn_step[pair.second], gaps.distance[i]);
        };
        if (is_open(parameters.recheck_factor, parameters.steps_ahead)) {
            gaps.recheck_at(group, here.scene + travel.min_scene_travel(pair, gaps.width[i] - traveled));
            continue;
        }
        leave = true;
        gaps.skipped[i] = 0;
        gaps.monitored[i] = is_open(1.0, 1.0) ? GapState::from_step_end : 1;
        if (gaps.monitored[i] == 1) unsampled_.push_back(i);
    }
    return leave;
}

// Undo the last step, which is repeated: gaps to be sampled at its end were not sampled.
void GapWatch::undo_step() {
    for (int i : gaps.monitored_gaps) {
        if (gaps.monitored[i] != GapState::from_step_end) continue;
        gaps.monitored[i] = 0;
        gaps.skipped[i] = 1;
        gaps.recheck_at(group_[i], 0.0);
    }
    gaps.list_monitored();
}

void GapWatch::step(const VecX& speed, double h) {
    unsampled_.clear();
    TravelState& here = gaps.travel;
    travel.step(w.now.terms, speed, h, here);
    if (here.max_total + parameters.steps_ahead * here.max_step < gaps.recheck_travel) return;
    travel.sum_up(here);
    if (!(here.scene + parameters.steps_ahead * here.scene_step < gaps.recheck_travel)) recheck_skipped();
}

const std::vector<int>& GapWatch::follow(const VecX& speed, double h) {
    end.clear();
    if (followed) undo_step();
    followed = true;
    step(speed, h);
    return unsampled_;
}

void GapWatch::begin_time_steps(double least) {
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        gaps.skipped[i] = gaps.current && gaps.skipped[i] && gaps.width[i] > least;
        gaps.monitored[i] = !gaps.skipped[i] && !is_bare(p, i);
    }
    gaps.list_monitored();
    if (!gaps.current) {
        gaps.travel.placed = false;
        gaps.recheck_all_at(HUGE_VAL);
    }
    followed = gaps.current = false;
}

bool GapWatch::stays_open_in_step(int gap) const {
    const TravelBound::Pair& pair = travel.pair(gap);
    if (!gaps.travel.summed || pair.is_unknown || pair.plane_rotates) return false;
    const double path_length = parameters.min_skipped_steps * travel.step_path_length(gaps.travel, gap);
    return gaps.width[gap] > TravelBound::max_change(pair, path_length, 0.0, 0.0);
}

const std::vector<int>& GapWatch::advance(const VecX& path_length) {
    step(path_length, 1.0);
    gaps.travel.add_step();
    return gaps.monitored_gaps;
}

const std::vector<char>& GapWatch::open_after(const VecX& path_length) {
    ahead_ = gaps.travel;
    travel.step(w.now.terms, path_length, 1.0, ahead_);
    travel.sum_up(ahead_);
    const double reached = ahead_.scene + ahead_.scene_step;
    open_ = gaps.skipped;
    for (size_t group = 0; group < gaps.group_recheck.size(); ++group)
        if (!(reached < gaps.group_recheck[group]))
            std::fill(open_.begin() + first_of_group_[group], open_.begin() + first_of_group_[group + 1], char(0));
    return open_;
}

GapSample GapSample::here(const Program& p, const Workspace& w, int gap, double part) {
    GapSample out{part, gap_width(p, w, gap), gap_rate(p, w, gap), std::nullopt};
    if (Separation::has(p, gap)) out.separation = Separation::of(p, w, gap);
    return out;
}

void GapState::keep(int gap, const GapSample& sample) {
    width[gap] = sample.width;
    rate[gap] = sample.rate;
    if (sample.separation) separation[gap] = *sample.separation;
}

Separation GapState::separation_of(int gap) const {
    const auto at = separation.find(gap);
    return at == separation.end() ? Separation() : at->second;
}

void GapState::defer_retry(int gap, double t) {
    if (retry_time[gap] == -HUGE_VAL) blocked_since[gap] = t;
    retry_time[gap] = t + std::max(GapWatch::parameters.min_retry_delay, t - blocked_since[gap]);
}

void GapState::list_monitored() {
    monitored_gaps.clear();
    for (size_t i = next_other(monitored, 0, char(0)); i < monitored.size(); i = next_other(monitored, i + 1, char(0)))
        monitored_gaps.push_back(static_cast<int>(i));
}

}  // namespace pn
