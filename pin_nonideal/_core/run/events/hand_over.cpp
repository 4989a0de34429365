#include "run/events/hand_over.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "math/tolerances.hpp"
#include "run/events/unloaded_contacts.hpp"
#include "tree/lie_group.hpp"

namespace pn {

namespace {

// Check if a gap belongs to a plane without edges, or to a joint.
bool has_one_feature(const Program& p, int gap) {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    return visit_as<PlaneGap>(kind, [](const auto&) {}) || std::holds_alternative<LimitRow>(kind);
}

}  // namespace

HandOver::HandOver(System& system, Progress& progress)
    : system_(system), progress_(progress), p(system.p), w(system.w), move_(VecX::Zero(system.nv)),
      y_(VecX::Zero(system.ny)) {}

bool HandOver::is_reached(double time) const {
    return time <= parameters.steady_time * std::max(1.0, std::abs(progress_.t));
}

double HandOver::step_before(double time) { return (1.0 - parameters.left_before) * time; }

// Set y_ to the state after a time.
void HandOver::move(double time) {
    system_.read(progress_.y);
    const auto a = system_.velocity(progress_.rate);
    move_ = time * (system_.v + 0.5 * time * a);
    y_ = progress_.y + time * progress_.rate;
    retract(p.mechanism, system_.q.data(), move_.data(), y_.data());
}

double HandOver::bias(int gap) {
    follow_gap(p, w, progress_.t, system_.v, gap);
    return w.now.values[p.gaps[gap].block].bias[0];
}

double HandOver::bias_after(double time, int gap) {
    move(time);
    system_.read(y_);
    update_kinematics(p, w, progress_.t + time, system_.q, system_.v);
    return bias(gap);
}

// Check if the bias of a gap jumps within `size`, and reduce `size` to the first time after the jump.
bool HandOver::find(int gap, double& size) {
    double low = 0.0, high = size, at_low = bias_after(low, gap), at_high = bias_after(high, gap);
    const double acceleration = p.mechanism.gravity.norm() + system_.velocity(progress_.rate).cwiseAbs().maxCoeff();
    const double scale = acceleration + std::abs(at_low);
    const double min_jump = std::max(parameters.kept_bias_change * std::abs(at_high - at_low), min_bias_jump * scale);
    const double width = parameters.width * std::max(1.0, std::abs(progress_.t));
    while (high - low > width) {
        const double middle = 0.5 * (low + high);
        if (!(low < middle && middle < high)) break;
        const double at_middle = bias_after(middle, gap);
        const double jump_before = std::abs(at_middle - at_low), jump_after = std::abs(at_high - at_middle);
        if (!(std::max(jump_before, jump_after) >= min_jump)) return false;
        const bool is_before = jump_before >= min_jump;
        (is_before ? high : low) = middle;
        (is_before ? at_high : at_low) = at_middle;
    }
    size = high;
    return true;
}

std::optional<HandOver::Found> HandOver::first(double size) {
    std::optional<Found> next;
    for (int gap : w.now.closed_gaps) {
        if (is_bare(p, gap) || p.is_users(gap) || has_one_feature(p, gap)) continue;
        if (find(gap, size)) next = Found{size, gap};
    }
    return next;
}

bool HandOver::is_unloaded(int gap) {
    system_.read(progress_.y);
    begin_step(p, w, progress_.t, system_.q, system_.v);
    return pn::is_unloaded(system_, progress_.t, gap);
}

// The state lies a little past the hand-over, so that rounding does not decide if another contact passes it too.
void HandOver::pass(double time) {
    const double past = time + parameters.passing_time * std::max(1.0, std::abs(progress_.t));
    move(past);
    progress_.y = y_;
    progress_.t += past;
}

}  // namespace pn
