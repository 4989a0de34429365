#include "run/events/gap_watch.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"

namespace pn {

GapWatch::GapWatch(System& system, GapState& state)
    : gaps(state), travel(system.p), system_(system), p(system.p), w(system.w) {
    bool round = false;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) round |= Separation::has(p, i);
    gaps = GapState(p.gaps.size(), round);
    travel.size(gaps.travel);
}

void GapWatch::look(double t, int gap) {
    follow_gap(p, w, t, system_.v, gap);
    gaps.keep(gap, GapSample::here(p, w, gap, 0.0));
}

void GapWatch::place(int gap) {
    const TravelBound::Pair& pair = travel.pair(gap);
    gaps.near[gap] = 1;
    gaps.far[gap] = 0;
    if (pair.unknown) return;
    gaps.apart[gap] = pair.turns ? travel.apart(w.now.terms, gap) : 0.0;
    const double way = parameters.steps_of_far * travel.way_of_step(gaps.travel, gap);
    const double turn = parameters.steps_of_far * gaps.travel.turn_step[pair.second];
    if (!(gaps.width[gap] > TravelBound::change(pair, way, turn, gaps.apart[gap]))) return;
    gaps.near[gap] = 0;
    gaps.far[gap] = 1;
    gaps.way[gap] = travel.way(gaps.travel, gap);
    gaps.turn[gap] = gaps.travel.turn[pair.second];
    gaps.ask = std::min(gaps.ask, gaps.travel.scene + travel.least_way(pair, gaps.width[gap]));
}

void GapWatch::sample_all(double t) {
    followed = gaps.travel.placed = false;
    travel.sum_up(gaps.travel);
    gaps.current = true;
    gaps.ask = HUGE_VAL;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        gaps.near[i] = gaps.far[i] = 0;
        if (is_bare(p, i)) continue;
        measure_gap(p, w, t, system_.v, i);
        gaps.width[i] = gap_width(p, w, i);
        gaps.rate[i] = 0.0;
        if (!w.state.closed[i]) place(i);
        if (gaps.far[i]) continue;
        move_gap(p, w, t, system_.v, i);
        gaps.keep(i, GapSample::here(p, w, i, 0.0));
    }
    gaps.find_near();
}

void GapWatch::sample_near_gaps(double t) {
    if (!followed) return sample_all(t);
    followed = false;
    gaps.travel.add_step();
    for (int i : w.now.touching)
        if (Separation::has(p, i)) look(t, i);
    for (size_t k = 0; k < gaps.near_gaps.size(); ++k) gaps.keep(gaps.near_gaps[k], end[k]);
    leave_far();
}

void GapWatch::leave_far() {
    const auto stays = [&](int i) { return !(gaps.width[i] > 0.0) && gaps.near[i] == 1; };
    if (std::all_of(gaps.near_gaps.begin(), gaps.near_gaps.end(), stays)) return;
    travel.sum_up(gaps.travel);
    bool leave = false;
    for (int i : gaps.near_gaps) {
        place(i);
        leave |= gaps.far[i];
    }
    if (leave) gaps.find_near();
}

// Monitor the far gaps whose bodies may have traveled half of the width. If a gap is proven open over the step, it is
// sampled at the step's end only. Other gaps are returned in `unseen_`, for a sample at the step's start.
void GapWatch::ask_far() {
    const TravelState& here = gaps.travel;
    gaps.ask = HUGE_VAL;
    bool found = false;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (!gaps.far[i]) continue;
        const TravelBound::Pair& pair = travel.pair(i);
        const double way = travel.way(here, i), come = way - gaps.way[i] + parameters.way_rounding * way;
        const double turn = here.turn[pair.second], turned = turn - gaps.turn[i] + parameters.way_rounding * turn;
        const auto is_open = [&](double times, double steps) {
            return gaps.width[i] > TravelBound::change(pair, times * come + steps * travel.way_of_step(here, i),
                                                    times * turned + steps * here.turn_step[pair.second], gaps.apart[i]);
        };
        if (is_open(parameters.asked_again, parameters.steps_ahead)) {
            gaps.ask = std::min(gaps.ask, here.scene + travel.least_way(pair, gaps.width[i] - come));
            continue;
        }
        found = true;
        gaps.far[i] = 0;
        gaps.near[i] = is_open(1.0, 1.0) ? GapState::from_the_end : 1;
        if (gaps.near[i] == 1) unseen_.push_back(i);
    }
    if (found) gaps.find_near();
}

// Undo the last step, which is repeated: gaps to be sampled at its end were not sampled.
void GapWatch::take_back() {
    for (int i : gaps.near_gaps) {
        if (gaps.near[i] != GapState::from_the_end) continue;
        gaps.near[i] = 0;
        gaps.far[i] = 1;
        gaps.ask = 0.0;
    }
    gaps.find_near();
}

void GapWatch::step(const VecX& speed, double h) {
    unseen_.clear();
    TravelState& here = gaps.travel;
    travel.step(w.now.terms, speed, h, here);
    if (here.max_total + parameters.steps_ahead * here.max_step < gaps.ask) return;
    travel.sum_up(here);
    if (!(here.scene + parameters.steps_ahead * here.scene_step < gaps.ask)) ask_far();
}

const std::vector<int>& GapWatch::follow(const VecX& speed, double h) {
    end.clear();
    if (followed) take_back();
    followed = true;
    step(speed, h);
    return unseen_;
}

void GapWatch::begin_time_steps(double least) {
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        gaps.far[i] = gaps.current && gaps.far[i] && gaps.width[i] > least;
        gaps.near[i] = !gaps.far[i] && !is_bare(p, i);
    }
    gaps.find_near();
    if (!gaps.current) {
        gaps.travel.placed = false;
        gaps.ask = HUGE_VAL;
    }
    followed = gaps.current = false;
}

bool GapWatch::stays_open_in_step(int gap) const {
    const TravelBound::Pair& pair = travel.pair(gap);
    if (!gaps.travel.summed || pair.unknown || pair.turns) return false;
    const double way = parameters.steps_of_far * travel.way_of_step(gaps.travel, gap);
    return gaps.width[gap] > TravelBound::change(pair, way, 0.0, 0.0);
}

const std::vector<int>& GapWatch::come(const VecX& way) {
    step(way, 1.0);
    gaps.travel.add_step();
    return gaps.near_gaps;
}

GapSample GapSample::here(const Program& p, const Workspace& w, int gap, double part) {
    GapSample out{part, gap_width(p, w, gap), gap_rate(p, w, gap), std::nullopt};
    if (Separation::has(p, gap)) out.separation = Separation::of(p, w, gap);
    return out;
}

void GapState::keep(int gap, const GapSample& look) {
    width[gap] = look.width;
    rate[gap] = look.rate;
    if (look.separation) separation[gap] = *look.separation;
}

void GapState::defer_retry(int gap, double t) {
    if (retry_time[gap] == -HUGE_VAL) blocked_since[gap] = t;
    retry_time[gap] = t + std::max(GapWatch::parameters.least_rest, t - blocked_since[gap]);
}

void GapState::find_near() {
    near_gaps.clear();
    for (int i = 0; i < static_cast<int>(near.size()); ++i)
        if (near[i]) near_gaps.push_back(i);
}

}  // namespace pn
