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

// g = n . (x1 - x2) - r, with n fixed in body 2, for a point of body 1 at distance `reach` from its frame.
double CurvatureBounds::over_plane(const Workspace& w, const Frame& frame, const Frame& plane, double reach) const {
    const Bound a = frame_bound(frame), b = frame_bound(plane);
    const double velocity = a.velocity + reach * a.spin + b.velocity;
    double turning = 0.0;
    if (b.spin > 0.0 || b.spin_rate > 0.0) {
        const Pose one(p.mechanism, w.now.terms, frame), two(p.mechanism, w.now.terms, plane);
        const double apart = (one.x - two.x).norm() + reach + h_ * velocity;
        turning = 2.0 * b.spin * velocity + (b.spin_rate + b.spin * b.spin) * apart;
    }
    return a.acceleration + reach * (a.spin_rate + a.spin * a.spin) + b.acceleration + turning;
}

double CurvatureBounds::of(const Workspace& w, const PlanePointRow& kind) const {
    return over_plane(w, kind.frame1, kind.frame2, 0.0);
}

// The bound holds for each point of the ellipsoid, whichever is the lowest.
double CurvatureBounds::of(const Workspace& w, const PlaneEllipsoidRow& kind) const {
    return over_plane(w, kind.frame1, kind.frame2, kind.reach());
}

// g = |c1 - c2| - r, minimum over both segments. The bound holds for all pairs of points fixed on their bodies.
double CurvatureBounds::of(const Workspace&, const CapsuleCapsuleRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.acceleration + b.acceleration + kind.half1 * (a.spin_rate + a.spin * a.spin) +
           kind.half2 * (b.spin_rate + b.spin * b.spin);
}

double CurvatureBounds::of(const Workspace&, const CapsuleCylinderRow& kind) const {
    return of_points(kind.frame1, kind.half1, kind.frame2, kind.solid.reach);
}

double CurvatureBounds::of(const Workspace&, const DiskHullRow& kind) const {
    return of_points(kind.frame1, kind.rim, kind.frame2, kind.solid.reach);
}

double CurvatureBounds::of(const Workspace&, const CylinderCylinderRow& kind) const {
    return of_points(kind.frame1, kind.first.reach, kind.frame2, kind.second.reach);
}

// Bound for any two points at these distances from their frames.
double CurvatureBounds::of_points(const Frame& frame1, double reach1, const Frame& frame2, double reach2) const {
    const Bound a = frame_bound(frame1), b = frame_bound(frame2);
    return a.acceleration + b.acceleration + reach1 * (a.spin_rate + a.spin * a.spin) +
           reach2 * (b.spin_rate + b.spin * b.spin);
}

double CurvatureBounds::of(const Workspace&, const PointBoxRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.acceleration + b.acceleration + kind.half.norm() * (b.spin_rate + b.spin * b.spin);
}

template <class Solid>
double CurvatureBounds::of(const Workspace&, const SolidHullRow<Solid>& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.acceleration + b.acceleration + kind.solid.reach * (b.spin_rate + b.spin * b.spin);
}

double CurvatureBounds::of(const Workspace&, const LimitRow& kind) const {
    return acceleration_[p.mechanism.joints[kind.joint].iv];
}

double CurvatureBounds::lower_bound(const Workspace& w, int gap) const {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    if (const auto* contact = std::get_if<PlanePointRow>(&kind)) return of(w, *contact);
    if (const auto* capsules = std::get_if<CapsuleCapsuleRow>(&kind)) return of(w, *capsules);
    if (const auto* box = std::get_if<PointBoxRow>(&kind)) return of(w, *box);
    if (const auto* ellipsoid = std::get_if<PlaneEllipsoidRow>(&kind)) return of(w, *ellipsoid);
    if (const auto* hull = std::get_if<HullRow>(&kind)) return of(w, *hull);
    if (const auto* revolved = std::get_if<RevolvedRow>(&kind)) return of(w, *revolved);
    if (const auto* line = std::get_if<CapsuleCylinderRow>(&kind)) return of(w, *line);
    if (const auto* rim = std::get_if<DiskHullRow>(&kind)) return of(w, *rim);
    if (const auto* rims = std::get_if<CylinderCylinderRow>(&kind)) return of(w, *rims);
    return of(w, std::get<LimitRow>(kind));
}

// Maximum relative speed of the end points of a contact. Infinite if the plane rotates, because planes are unbounded.
double CurvatureBounds::speed(const PlanePointRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return b.spin > 0.0 ? HUGE_VAL : a.velocity + b.velocity;
}

double CurvatureBounds::speed(const PlaneEllipsoidRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return b.spin > 0.0 ? HUGE_VAL : a.velocity + kind.reach() * a.spin + b.velocity;
}

double CurvatureBounds::speed(const CapsuleCapsuleRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.velocity + kind.half1 * a.spin + b.velocity + kind.half2 * b.spin;
}

double CurvatureBounds::speed(const CapsuleCylinderRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.velocity + kind.half1 * a.spin + b.velocity + kind.solid.reach * b.spin;
}

double CurvatureBounds::speed(const DiskHullRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.velocity + kind.rim * a.spin + b.velocity + kind.solid.reach * b.spin;
}

double CurvatureBounds::speed(const CylinderCylinderRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.velocity + kind.first.reach * a.spin + b.velocity + kind.second.reach * b.spin;
}

double CurvatureBounds::speed(const PointBoxRow& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.velocity + b.velocity + kind.half.norm() * b.spin;
}

template <class Solid>
double CurvatureBounds::speed(const SolidHullRow<Solid>& kind) const {
    const Bound a = frame_bound(kind.frame1), b = frame_bound(kind.frame2);
    return a.velocity + b.velocity + kind.solid.reach * b.spin;
}

double CurvatureBounds::speed(int gap) const {
    return std::visit([&](const auto& kind) { return speed(kind); }, p.blocks[p.gaps[gap].block].kind);
}

bool CurvatureBounds::has_bounds(const Program& p, int gap) { return !p.is_users(gap); }

// Points that pass each other at distance d with relative speed u separate with acceleration u^2 / d. A change of the
// nearest points only reduces this. reach1 and reach2 are the extents of the contact's geometry from its frames.
double CurvatureBounds::upper_bound(double reach1, double reach2, const Frame& frame1, const Frame& frame2,
                                    double radius) const {
    const Bound a = frame_bound(frame1), b = frame_bound(frame2);
    const double velocity = a.velocity + b.velocity + reach1 * a.spin + reach2 * b.spin;
    return velocity * velocity / radius;
}

double CurvatureBounds::upper_bound(const Workspace& w, int gap) const {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    double passing = 0.0;
    if (const auto* c = std::get_if<CapsuleCapsuleRow>(&kind))
        passing = upper_bound(c->half1, c->half2, c->frame1, c->frame2, c->radius);
    else if (const auto* box = std::get_if<PointBoxRow>(&kind))
        passing = upper_bound(0.0, box->half.norm(), box->frame1, box->frame2, box->radius);
    else if (const auto* hull = std::get_if<HullRow>(&kind))
        passing = upper_bound(0.0, hull->solid.reach, hull->frame1, hull->frame2, hull->radius);
    else if (const auto* revolved = std::get_if<RevolvedRow>(&kind))
        passing = upper_bound(0.0, revolved->solid.reach, revolved->frame1, revolved->frame2, revolved->radius);
    else if (const auto* line = std::get_if<CapsuleCylinderRow>(&kind))
        passing = upper_bound(line->half1, line->solid.reach, line->frame1, line->frame2, line->radius);
    else if (const auto* rim = std::get_if<DiskHullRow>(&kind))
        passing = upper_bound(rim->rim, rim->solid.reach, rim->frame1, rim->frame2, rim->radius);
    else if (const auto* rims = std::get_if<CylinderCylinderRow>(&kind))
        passing = upper_bound(rims->first.reach, rims->second.reach, rims->frame1, rims->frame2, rims->radius);
    return lower_bound(w, gap) + passing;
}

}  // namespace pn
