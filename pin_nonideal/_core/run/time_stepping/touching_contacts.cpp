// Contacts that take part in a step of MoreauContacts: their gaps are closed at its middle, or were closed before.
#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "run/time_stepping/moreau_contacts.hpp"
#include "tree/lie_group.hpp"
#include "tree/terms.hpp"

namespace pn {

double MoreauContacts::allowed(double t, double h, const VecX& y) {
    if (!rounded_) return h;
    bool placed = false;
    double shortest = h;
    for (int i : watch_.gaps.near_gaps) {
        if (!(rounded_by_[i] < HUGE_VAL) || w.state.closed[i] || watch_.stays_open_in_step(i)) continue;
        if (!placed) {
            system_.read(y);
            kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
            placed = true;
        }
        follow_gap(p, w, t, system_.v, i);
        const double width = gap_width(p, w, i), rate = gap_rate(p, w, i);
        if (!(rate < 0.0) || !tells_way_out(i, width)) continue;
        const double reach = std::max(width, 0.0) + (width > 0.0 ? 0.5 : 1.0) * depth_left(p, w, i, width);
        shortest = std::min(shortest, reach / -rate);
    }
    return shortest;
}

// Return the travel of each dof since the last sample of the gaps, including projections. It is at least that of the
// velocity, because angles wrap around.
const VecX& MoreauContacts::way_since_last() {
    q_sampled_ -= q_mid_;
    ambient_to_tangent(p.mechanism, q_mid_.data(), q_sampled_.data(), v1_.data());
    force_ = v1_.cwiseAbs().cwiseMax(h_ * v0_.cwiseAbs());
    q_sampled_ = q_mid_;
    return force_;
}

// Find the contacts whose gap is closed at the step's middle, and contacts that were closed before. Their loads decide
// if they stay closed.
void MoreauContacts::find_touching(double t) {
    touching_.clear();
    for (int i : watch_.come(way_since_last())) {
        measure_gap(p, w, t, mean_.value(), i);
        const double width = gap_width(p, w, i);
        const bool touches = was_closed_[i] || (width <= 0.0 && tells_way_out(i, width));
        if (touches) touching_.push_back(i);
        watch_.gaps.width[i] = touches ? 0.0 : width - parameters.width_rounding * scene_size(p, w);  // guaranteed width
    }
    watch_.leave_far();
    for (int i : touching_) {
        evaluate_block(p, w, t, mean_.value(), p.gaps[i].block);
        for (int e : p.gaps[i].elements) evaluate_block(p, w, t, mean_.value(), p.frictions[e].block);
    }
    if (touching_.size() > 1)
        leave_one_of_each_place(p, w, touching_, [&](int i, int other) { return was_closed_[i] && !was_closed_[other]; });
}

// Evaluate the contacts that take part at a new mean velocity.
void MoreauContacts::move_touching(double t) {
    for (int i : touching_) {
        move_block(p, w, t, mean_.value(), p.gaps[i].block);
        for (int e : p.gaps[i].elements) move_block(p, w, t, mean_.value(), p.frictions[e].block);
    }
    elements_.move(p, w);
}

}  // namespace pn
