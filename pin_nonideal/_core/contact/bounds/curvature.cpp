#include "contact/bounds/curvature.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

CurvatureBounds::CurvatureBounds(const Program& program) : p(program), bodies_(program.mechanism.joints.size()) {
    std::vector<char> needed(bodies_.size(), 0);
    for (const Gap& gap : p.gaps)
        for (int joint : {p.blocks[gap.block].joint1, p.blocks[gap.block].joint2})
            for (; joint != 0; joint = p.mechanism.joints[joint].parent) needed[joint] = 1;
    for (size_t joint = 1; joint < needed.size(); ++joint)
        if (needed[joint]) joints_.push_back(static_cast<int>(joint));
}

// Motion of a joint's body relative to its parent, in the parent's axes.
CurvatureBounds::Bound CurvatureBounds::joint_bound(const Joint& joint) const {
    const auto v = speed_.segment(joint.iv, joint.nv), a = acceleration_.segment(joint.iv, joint.nv);
    const double speed = v.norm(), rate = a.norm();
    switch (joint.kind) {
        case JointKind::revolute:
        case JointKind::spherical: return {0.0, 0.0, speed, rate};
        case JointKind::prismatic:
        case JointKind::translation: return {speed, rate, 0.0, 0.0};
        case JointKind::helical: return {std::abs(joint.pitch) * speed, std::abs(joint.pitch) * rate, speed, rate};
        default: break;
    }
    const int slides = joint.kind == JointKind::free_flyer ? 3 : joint.kind == JointKind::planar ? 2 : joint.nv;
    const bool other = slides == joint.nv;  // unknown joint kind: each dof may translate and rotate
    const double spin = other ? speed : v.tail(joint.nv - slides).norm();
    const double slide = v.head(slides).norm();
    // Velocities of a floating base are in its own rotating axes.
    const double spin_rate = other ? rate + speed * speed : a.tail(joint.nv - slides).norm();
    return {slide, a.head(slides).norm() + spin * slide, spin, spin_rate};
}

void CurvatureBounds::bound_bodies(const Workspace& w, const VecX& speed, const VecX& acceleration, double h) {
    speed_ = speed;
    acceleration_ = acceleration;
    h_ = h;
    for (int i : joints_) {
        const Joint& joint = p.mechanism.joints[i];
        const Body &body = w.now.terms.body[i], &parent = w.now.terms.body[joint.parent];
        const Bound base = bodies_[joint.parent], move = joint_bound(joint);
        const Vec3 from = joint.parent == 0 ? body.ref + body.p : body.ref + body.p - parent.ref - parent.p;
        const double apart = joint.parent == 0 ? 0.0 : from.norm() + h * move.velocity;
        bodies_[i] = {base.velocity + base.spin * apart + move.velocity,
                      base.acceleration + (base.spin_rate + base.spin * base.spin) * apart +
                          2.0 * base.spin * move.velocity + move.acceleration,
                      base.spin + move.spin, base.spin_rate + move.spin_rate + base.spin * move.spin};
    }
}

CurvatureBounds::Bound CurvatureBounds::frame_bound(const Frame& frame) const {
    if (frame.joint == 0) return {};
    const Bound& body = bodies_[frame.joint];
    const double apart = frame.p.norm();
    return {body.velocity + body.spin * apart,
            body.acceleration + (body.spin_rate + body.spin * body.spin) * apart, body.spin, body.spin_rate};
}

// g = n . (x1 - x2) - r, with n fixed in body 2, for a point of body 1 at distance `extent` from its frame.
double CurvatureBounds::over_plane(const Workspace& w, const Frame& frame, const Frame& plane, double extent) const {
    const Bound a = frame_bound(frame), b = frame_bound(plane);
    const double velocity = a.velocity + extent * a.spin + b.velocity;
    double turning = 0.0;
    if (b.spin > 0.0 || b.spin_rate > 0.0) {
        const Pose one(p.mechanism, w.now.terms, frame), two(p.mechanism, w.now.terms, plane);
        const double apart = (one.x - two.x).norm() + extent + h_ * velocity;
        turning = 2.0 * b.spin * velocity + (b.spin_rate + b.spin * b.spin) * apart;
    }
    return a.acceleration + extent * (a.spin_rate + a.spin * a.spin) + b.acceleration + turning;
}

// g = |x1 - x2| - r, for any two points at these distances from their frames.
double CurvatureBounds::of_points(const Frame& frame1, double extent1, const Frame& frame2, double extent2) const {
    const Bound a = frame_bound(frame1), b = frame_bound(frame2);
    return a.acceleration + b.acceleration + extent1 * (a.spin_rate + a.spin * a.spin) +
           extent2 * (b.spin_rate + b.spin * b.spin);
}

// The bound holds for each point or pair of points that is fixed on its body, whichever is the nearest.
double CurvatureBounds::lower_bound(const Workspace& w, int gap) const {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    double bound = HUGE_VAL;
    visit_as<ShapeGap>(kind, [&](const auto& k) { bound = of_points(k.frame1, k.extent1(), k.frame2, k.extent2()); });
    visit_as<PlaneGap>(kind, [&](const auto& k) { bound = over_plane(w, k.frame1, k.frame2, k.extent1()); });
    visit_as<LimitRow>(kind, [&](const auto& k) { bound = acceleration_[p.mechanism.joints[k.joint].iv]; });
    return bound;
}

// Infinite if a plane rotates, because planes are unbounded.
double CurvatureBounds::speed(int gap) const {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    double speed = HUGE_VAL;
    visit_as<ShapeGap>(kind, [&](const auto& k) {
        const Bound a = frame_bound(k.frame1), b = frame_bound(k.frame2);
        speed = a.velocity + k.extent1() * a.spin + b.velocity + k.extent2() * b.spin;
    });
    visit_as<PlaneGap>(kind, [&](const auto& k) {
        const Bound a = frame_bound(k.frame1), b = frame_bound(k.frame2);
        if (!(b.spin > 0.0)) speed = a.velocity + k.extent1() * a.spin + b.velocity;
    });
    visit_as<LimitRow>(kind, [&](const auto& k) { speed = speed_[p.mechanism.joints[k.joint].iv]; });
    return speed;
}

bool CurvatureBounds::has_bounds(const Program& p, int gap) { return !p.is_users(gap); }

// Points that pass each other at distance d with relative speed u separate with acceleration u^2 / d. A change of the
// nearest points only reduces this.
double CurvatureBounds::upper_bound(const Workspace& w, int gap) const {
    double passing = 0.0;
    visit_as<ShapeGap>(p.blocks[p.gaps[gap].block].kind, [&](const auto& k) {
        const double velocity = speed(gap);
        passing = velocity * velocity / k.radius;
    });
    return lower_bound(w, gap) + passing;
}

}  // namespace pn
