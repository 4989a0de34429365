#include "run/gap_watch.hpp"

#include <algorithm>
#include <cmath>

#include "contact/gaps.hpp"
#include "dynamics/evaluation.hpp"

namespace pn {

// A gap is far from so many times the way of a step on: nearer ones would be asked again at once.
constexpr double steps_of_far = 4.0;
// A gap that was asked in vain is not asked again for this long [s]; then for as long as it has been in vain.
constexpr double least_rest = 1e-4;

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
    const double way = steps_of_far * ways.way_of_step(gaps.ways, gap);
    const double turn = steps_of_far * gaps.ways.turn_step[pair.second];
    if (!(gaps.width[gap] > WayBound::change(pair, way, turn, gaps.apart[gap]))) return;
    gaps.near[gap] = 0;
    gaps.far[gap] = 1;
    gaps.way[gap] = ways.way(gaps.ways, gap);
    gaps.turn[gap] = gaps.ways.turn[pair.second];
    gaps.ask = std::min(gaps.ask, gaps.ways.scene + ways.least_way(pair, gaps.width[gap]));
}

void GapWatch::look_at_all(double t) {
    followed = gaps.ways.placed = false;
    gaps.current = true;
    gaps.ask = HUGE_VAL;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        gaps.near[i] = gaps.far[i] = 0;
        if (is_bare(p, i)) continue;
        look(t, i);
        if (!w.state.closed[i]) place(i);
    }
    gaps.find_near();
}

void GapWatch::go_on(double t) {
    if (!followed) return look_at_all(t);
    followed = false;
    gaps.ways.go_on();
    for (int i : w.now.touching)
        if (Separation::has(p, i)) look(t, i);
    bool leave = false;
    for (size_t k = 0; k < gaps.near_gaps.size(); ++k) {
        const int i = gaps.near_gaps[k];
        gaps.keep(i, end[k]);
        place(i);
        leave |= gaps.far[i];
    }
    if (leave) gaps.find_near();
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
    rests_until[gap] = t + std::max(least_rest, t - vain_since[gap]);
}

void GapState::find_near() {
    near_gaps.clear();
    for (int i = 0; i < static_cast<int>(near.size()); ++i)
        if (near[i]) near_gaps.push_back(i);
}

}  // namespace pn
