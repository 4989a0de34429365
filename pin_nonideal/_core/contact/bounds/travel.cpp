#include "contact/bounds/travel.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

bool turns(JointKind kind) { return kind != JointKind::prismatic && kind != JointKind::translation; }
bool slides(JointKind kind) { return kind != JointKind::revolute && kind != JointKind::spherical; }

}  // namespace

static void add(const std::vector<double>& parts, std::vector<double>& sums) {
    for (size_t i = 0; i < sums.size(); ++i) sums[i] = (sums[i] + parts[i]) * TravelBound::parameters.rounded_up;
}

void TravelState::add_bodies() {
    add(body_step, body);
    add(joint_step, joint);
    add(turn_step, turn);
    max_total = scene = (scene + scene_step) * TravelBound::parameters.rounded_up;
}

void TravelState::add_step() {
    if (summed) return add_bodies();
    add(slid_step, slid);
    add(turned_step, turned);
    max_total = (max_total + max_step) * TravelBound::parameters.rounded_up;
}

TravelBound::TravelBound(const Program& program)
    : p(program), extent_(program.mechanism.joints.size(), 0.0), pairs_(program.gaps.size()) {
    const std::vector<Joint>& joints = p.mechanism.joints;
    std::vector<char> needed(joints.size(), 0), may_turn(joints.size(), 0);
    for (size_t i = 1; i < joints.size(); ++i) may_turn[i] = may_turn[joints[i].parent] || turns(joints[i].kind);
    for (size_t gap = 0; gap < p.gaps.size(); ++gap) {
        const Block& block = p.blocks[p.gaps[gap].block];
        Pair& pair = pairs_[gap];
        int ends[] = {0, 0};
        if (const auto* limit = std::get_if<LimitRow>(&block.kind)) {
            pair.joint = ends[0] = limit->joint;
            extent_[limit->joint] = std::max(extent_[limit->joint], parameters.lever_of_stop);
        } else if (const auto [first, second] = frames(block.kind); first && !p.is_users(static_cast<int>(gap))) {
            pair.first = ends[0] = first->joint;
            pair.second = ends[1] = second->joint;
            visit_as<PlaneGap>(block.kind, [&](const auto& k) {
                pair.plane_rotates = may_turn[pair.second];
                pair.reach = k.extent1();
            });
            double extent2 = 0.0;
            visit_as<ShapeGap>(block.kind, [&](const auto& k) {
                pair.reach = k.extent1();
                extent2 = k.extent2();
            });
            extent_[pair.first] = std::max(extent_[pair.first], first->p.norm() + pair.reach);
            extent_[pair.second] = std::max(extent_[pair.second], second->p.norm() + extent2);
        } else {
            pair.is_unknown = true;
        }
        for (int joint : ends) needed[joint] = 1;
    }
    for (size_t i = joints.size() - 1; i > 0; --i)
        if (needed[i]) needed[joints[i].parent] = 1;
    for (size_t i = 1; i < joints.size(); ++i) {
        if (!needed[i]) continue;
        const Joint& joint = joints[i];
        const double slide = joint.kind == JointKind::revolute ? 0.0
                             : joint.kind == JointKind::helical ? std::abs(joint.pitch) : 1.0;
        const double turn = joint.kind == JointKind::prismatic ? 0.0 : 1.0;
        const bool drifts = slides(joint.kind) && may_turn[joint.parent];
        moved_.push_back({static_cast<int>(i), joint.parent, joint.iv, joint.nv, joint.kind, slide, turn, drifts});
        drift_ |= drifts;
    }
}

void TravelBound::size(TravelState& travel) const {
    for (auto* each : {&travel.body, &travel.joint, &travel.turn, &travel.lever, &travel.slid, &travel.turned,
                       &travel.body_step, &travel.joint_step, &travel.turn_step, &travel.slid_step,
                       &travel.turned_step})
        each->assign(extent_.size(), 0.0);
    travel.slid_until.assign(extent_.size(), -1.0);
}

// Motion of a joint's body relative to its parent.
TravelBound::Speeds TravelBound::speeds(const Moved& moved, const VecX& speed) {
    if (moved.nv == 1) return {moved.slide * speed[moved.iv], moved.turn * speed[moved.iv]};
    const auto all = speed.segment(moved.iv, moved.nv);
    switch (moved.kind) {
        case JointKind::spherical: return {0.0, all.norm()};
        case JointKind::translation: return {all.norm(), 0.0};
        case JointKind::free_flyer: return {all.head(3).norm(), all.tail(3).norm()};
        case JointKind::planar: return {all.head(2).norm(), all[2]};
        default: return {all.norm(), all.norm()};  // unknown joint kind
    }
}

// Compute levers along the tree, from the farthest point of a body to its joint and on to the parent. Origins of
// rotating joints are fixed on the parent. Sliding joints get a margin.
void TravelBound::set_levers(const Terms& terms, TravelState& travel) const {
    for (const Moved& moved : moved_) travel.lever[moved.joint] = extent_[moved.joint];
    for (auto moved = moved_.rbegin(); moved != moved_.rend(); ++moved) {
        const int i = moved->joint, parent = moved->parent;
        if (parent == 0) continue;
        const Body &body = terms.body[i], &parent_body = terms.body[parent];
        double distance = (body.ref + body.p - parent_body.ref - parent_body.p).norm();
        if (slides(moved->kind)) {
            const double room =
                parameters.room_ahead * distance + parameters.steps_ahead * (travel.slid_step[i] + travel.turned_step[i]);
            travel.slid_until[i] = travel.joint[i] + room;
            distance += room;
        }
        travel.lever[parent] = std::max(travel.lever[parent], distance + travel.lever[i]);
    }
    travel.placed = true;
}

// Travel not yet summed uses the old levers.
void TravelBound::step(const Terms& terms, const VecX& speed, double h, TravelState& travel) const {
    const double time = parameters.travel_factor * h;
    bool slid_out = !travel.placed;
    for (const Moved& moved : moved_) {
        const int i = moved.joint;
        const Speeds of = speeds(moved, speed);
        travel.slid_step[i] = time * of.slide;
        travel.turned_step[i] = time * of.turn;
        if (!moved.drifts) continue;
        const double come = travel.joint[i] + travel.slid[i] + travel.turned[i];
        slid_out |= !(come + travel.slid_step[i] + travel.turned_step[i] <= travel.slid_until[i]);
    }
    if (slid_out) {
        sum_up(travel);
        set_levers(terms, travel);
    }
    travel.summed = false;
    travel.max_step = 0.0;
    for (const Moved& moved : moved_)
        travel.max_step += travel.slid_step[moved.joint] + travel.turned_step[moved.joint] * travel.lever[moved.joint];
    travel.max_step *= parameters.joints_rounded_up;
}

// Propagate along the tree: the travel of a body is the travel of its parent plus the travel of its joint.
void TravelBound::spread(const std::vector<double>& slid, const std::vector<double>& turned, TravelState& travel) const {
    travel.scene_step = 0.0;
    for (const Moved& moved : moved_) {
        const int i = moved.joint, parent = moved.parent;
        travel.joint_step[i] = slid[i] + turned[i];
        travel.turn_step[i] = travel.turn_step[parent] + turned[i];
        travel.body_step[i] = travel.body_step[parent] + slid[i] + turned[i] * travel.lever[i];
        travel.scene_step = std::max(travel.scene_step, travel.body_step[i]);
    }
}

void TravelBound::sum_up(TravelState& travel) const {
    if (travel.summed) return;
    spread(travel.slid, travel.turned, travel);
    travel.add_bodies();
    std::fill(travel.slid.begin(), travel.slid.end(), 0.0);
    std::fill(travel.turned.begin(), travel.turned.end(), 0.0);
    spread(travel.slid_step, travel.turned_step, travel);
    travel.summed = true;
}

double TravelBound::distance(const Terms& terms, int gap) const {
    const auto& [first, second] = frames(p.blocks[p.gaps[gap].block].kind);
    const Pose one(p.mechanism, terms, *first), other(p.mechanism, terms, *second);
    return (one.x - other.x).norm() + pairs_[gap].reach;
}

}  // namespace pn
