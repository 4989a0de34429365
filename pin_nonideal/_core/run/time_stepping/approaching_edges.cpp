#include "run/time_stepping/approaching_edges.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "tree/terms.hpp"

namespace pn {

ApproachingEdges::ApproachingEdges(System& system, const GapWatch& watch)
    : system_(system), p(system.p), w(system.w), watch_(watch) {
    for (const Gap& gap : p.gaps) rounded_by_.push_back(rounded_by(p.blocks[gap.block].kind));
    rounded_ = std::any_of(rounded_by_.begin(), rounded_by_.end(), [](double r) { return r < HUGE_VAL; });
}

bool ApproachingEdges::has_known_direction(int gap, double width) const {
    return width > -parameters.nearly_all * rounded_by_[gap] || width > -parameters.nearly_all * max_depth(p, w, gap);
}

double ApproachingEdges::allowed(double t, double h, const VecX& y) {
    near_.clear();
    if (!rounded_) return h;
    bool placed = false;
    double shortest = h;
    for (int i : watch_.gaps.monitored_gaps) {
        if (!(rounded_by_[i] < HUGE_VAL) || w.state.closed[i] || watch_.stays_open_in_step(i)) continue;
        if (!placed) {
            system_.read(y);
            kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
            placed = true;
        }
        follow_gap(p, w, t, system_.v, i);
        const double width = gap_width(p, w, i), rate = gap_rate(p, w, i);
        if (!has_known_direction(i, width)) continue;
        near_.push_back(i);
        if (!(rate < 0.0)) continue;
        const double reach = std::max(width, 0.0) + (width > 0.0 ? 0.5 : 1.0) * depth_left(p, w, i, width);
        shortest = std::min(shortest, reach / -rate);
    }
    return shortest;
}

bool ApproachingEdges::pass(double t, const VecX& y) {
    if (near_.empty()) return false;
    system_.read(y);
    place_bodies(p.mechanism, w.now.terms, system_.q);
    return std::any_of(near_.begin(), near_.end(), [&](int i) {
        if (w.state.closed[i]) return false;
        measure_gap(p, w, t, system_.v, i);
        return !has_known_direction(i, gap_width(p, w, i));
    });
}

}  // namespace pn
