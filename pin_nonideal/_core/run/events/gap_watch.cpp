#include "run/events/gap_watch.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"

namespace pn {

GapWatch::GapWatch(System& system, GapState& state)
    : gaps(state), ways(system.p), system_(system), p(system.p), w(system.w) {
    bool round = false;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) round |= Separation::has(p, i);
    gaps = GapState(p.gaps.size(), round);
    ways.size(gaps.ways);
}

void GapWatch::look(double t, int gap) {
    follow_gap(p, w, t, system_.v, gap);
    gaps.keep(gap, GapLook::here(p, w, gap, 0.0));
}

void GapWatch::place(int gap) {
    const WayBound::Pair& pair = ways.pair(gap);
    gaps.near[gap] = 1;
    gaps.far[gap] = 0;
    if (pair.unknown) return;
    gaps.apart[gap] = pair.turns ? ways.apart(w.now.terms, gap) : 0.0;
    const double way = parameters.steps_of_far * ways.way_of_step(gaps.ways, gap);
    const double turn = parameters.steps_of_far * gaps.ways.turn_step[pair.second];
    if (!(gaps.width[gap] > WayBound::change(pair, way, turn, gaps.apart[gap]))) return;
    gaps.near[gap] = 0;
    gaps.far[gap] = 1;
    gaps.way[gap] = ways.way(gaps.ways, gap);
    gaps.turn[gap] = gaps.ways.turn[pair.second];
    gaps.ask = std::min(gaps.ask, gaps.ways.scene + ways.least_way(pair, gaps.width[gap]));
}

void GapWatch::look_at_all(double t) {
    followed = gaps.ways.placed = false;
    ways.sum_up(gaps.ways);
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
        gaps.keep(i, GapLook::here(p, w, i, 0.0));
    }
    gaps.find_near();
}

void GapWatch::go_on(double t) {
    if (!followed) return look_at_all(t);
    followed = false;
    gaps.ways.go_on();
    for (int i : w.now.touching)
        if (Separation::has(p, i)) look(t, i);
    for (size_t k = 0; k < gaps.near_gaps.size(); ++k) gaps.keep(gaps.near_gaps[k], end[k]);
    leave_far();
}

void GapWatch::leave_far() {
    const auto stays = [&](int i) { return !(gaps.width[i] > 0.0) && gaps.near[i] == 1; };
    if (std::all_of(gaps.near_gaps.begin(), gaps.near_gaps.end(), stays)) return;
    ways.sum_up(gaps.ways);
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
    const Ways& here = gaps.ways;
    gaps.ask = HUGE_VAL;
    bool found = false;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (!gaps.far[i]) continue;
        const WayBound::Pair& pair = ways.pair(i);
        const double way = ways.way(here, i), come = way - gaps.way[i] + parameters.way_rounding * way;
        const double turn = here.turn[pair.second], turned = turn - gaps.turn[i] + parameters.way_rounding * turn;
        const auto is_open = [&](double times, double steps) {
            return gaps.width[i] > WayBound::change(pair, times * come + steps * ways.way_of_step(here, i),
                                                    times * turned + steps * here.turn_step[pair.second], gaps.apart[i]);
        };
        if (is_open(parameters.asked_again, parameters.steps_ahead)) {
            gaps.ask = std::min(gaps.ask, here.scene + ways.least_way(pair, gaps.width[i] - come));
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
    Ways& here = gaps.ways;
    ways.step(w.now.terms, speed, h, here);
    if (here.most + parameters.steps_ahead * here.most_step < gaps.ask) return;
    ways.sum_up(here);
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
        gaps.ways.placed = false;
        gaps.ask = HUGE_VAL;
    }
    followed = gaps.current = false;
}

bool GapWatch::stays_open_in_step(int gap) const {
    const WayBound::Pair& pair = ways.pair(gap);
    if (!gaps.ways.summed || pair.unknown || pair.turns) return false;
    return gaps.width[gap] > WayBound::change(pair, parameters.steps_of_far * ways.way_of_step(gaps.ways, gap), 0.0, 0.0);
}

const std::vector<int>& GapWatch::come(const VecX& way) {
    step(way, 1.0);
    gaps.ways.go_on();
    return gaps.near_gaps;
}

GapLook GapLook::here(const Program& p, const Workspace& w, int gap, double part) {
    GapLook out{part, gap_width(p, w, gap), gap_rate(p, w, gap), std::nullopt};
    if (Separation::has(p, gap)) out.separation = Separation::of(p, w, gap);
    return out;
}

void GapState::keep(int gap, const GapLook& look) {
    width[gap] = look.width;
    rate[gap] = look.rate;
    if (look.separation) separation[gap] = *look.separation;
}

void GapState::ask_in_vain(int gap, double t) {
    if (rests_until[gap] == -HUGE_VAL) vain_since[gap] = t;
    rests_until[gap] = t + std::max(GapWatch::parameters.least_rest, t - vain_since[gap]);
}

void GapState::find_near() {
    near_gaps.clear();
    for (int i = 0; i < static_cast<int>(near.size()); ++i)
        if (near[i]) near_gaps.push_back(i);
}

}  // namespace pn
