// Proof that two round bodies stay apart between two instants. The corners of one body are beyond a plane at both instants,
// and accelerations are bounded. Then no points can meet in between, whichever points are nearest.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/workspace.hpp"

namespace pn {

// Two segments, or a point, segment or disk and a box or another solid, at one instant.
struct Separation {
    std::array<Vec3, 8> apart;  // from the ends or corners of the second body to those of the first
    // Number of corners. Other solids have none. `apart` then holds the offset of the centers, the three axes of the
    // solid, and the half segment or disk axis of the first body.
    int corners = 0;
    Vec3 normal;                // from the nearest point of the second body to that of the first
    double radius = 0.0;        // sum of both radii

    // Check if the gap is of a supported kind.
    static bool has(const Program& p, int gap) {
        const Kind& kind = p.blocks[p.gaps[gap].block].kind;
        return std::holds_alternative<CapsuleCapsuleRow>(kind) || std::holds_alternative<PointBoxRow>(kind) ||
               std::holds_alternative<HullRow>(kind) || std::holds_alternative<RevolvedRow>(kind) ||
               std::holds_alternative<CapsuleCylinderRow>(kind) || std::holds_alternative<DiskHullRow>(kind) ||
               std::holds_alternative<CylinderCylinderRow>(kind);
    }
    static Separation of(const Program& p, const Workspace& w, int gap) {
        const Kind& kind = p.blocks[p.gaps[gap].block].kind;
        const auto& [frame1, frame2] = frames(kind);
        const Sides<Pose> s{{p.mechanism, w.now.terms, *frame1}, {p.mechanism, w.now.terms, *frame2}, 0.0};
        if (const auto* box = std::get_if<PointBoxRow>(&kind)) return of(s, *box);
        if (const auto* hull = std::get_if<HullRow>(&kind)) return of(s, *hull);
        if (const auto* revolved = std::get_if<RevolvedRow>(&kind)) return of(s, *revolved);
        if (const auto* line = std::get_if<CapsuleCylinderRow>(&kind)) return of(s, *line);
        if (const auto* rim = std::get_if<DiskHullRow>(&kind)) return of(s, *rim);
        if (const auto* rims = std::get_if<CylinderCylinderRow>(&kind)) return of(s, *rims);
        return of(s, std::get<CapsuleCapsuleRow>(kind));
    }
    static Separation of(const Sides<Pose>& s, const CapsuleCapsuleRow& kind) {
        const NearestPoints<Sides<Pose>> nearest(s, kind.half1, kind.half2);
        Separation out{{}, 4, nearest.n, kind.radius};
        for (int k = 0; k < 4; ++k)
            out.apart[k] = s.a.x + (k & 1 ? kind.half1 : -kind.half1) * nearest.e1 - s.b.x -
                           (k & 2 ? kind.half2 : -kind.half2) * nearest.e2;
        return out;
    }
    static Separation of(const Sides<Pose>& s, const PointBoxRow& kind) {
        const NearestOnBox<Sides<Pose>> nearest(s, kind.half);
        Separation out{{}, 8, nearest.n, kind.radius};
        for (int k = 0; k < 8; ++k) {
            out.apart[k] = s.a.x - s.b.x;
            for (int axis = 0; axis < 3; ++axis)
                out.apart[k] += (k >> axis & 1 ? kind.half[axis] : -kind.half[axis]) * nearest.e[axis];
        }
        return out;
    }
    template <class Solid>
    static Separation of(const Sides<Pose>& s, const SolidHullRow<Solid>& kind) {
        return of_middles(s, kind.nearest(s).n, kind.radius, Vec3::Zero());
    }
    static Separation of(const Sides<Pose>& s, const CapsuleCylinderRow& kind) {
        const NearestAlongLine<Sides<Pose>> nearest(s, kind.solid, kind.half1);
        return of_middles(s, nearest.at.n, kind.radius, kind.half1 * nearest.e);
    }
    static Separation of(const Sides<Pose>& s, const DiskHullRow& kind) {
        return of_middles(s, NearestOnDisk<Sides<Pose>>(s, kind.solid, kind.rim).n, kind.radius, s.a.R.col(2));
    }
    static Separation of(const Sides<Pose>& s, const CylinderCylinderRow& kind) {
        return of_middles(s, NearestOfCylinders<Sides<Pose>>(s, kind.first, kind.second).n, kind.radius, s.a.R.col(2));
    }
    static Separation of_middles(const Sides<Pose>& s, const Vec3& normal, double radius, const Vec3& axis_of_first) {
        Separation out{{}, 0, normal, radius};
        out.apart[0] = s.a.x - s.b.x;
        for (int axis = 0; axis < 3; ++axis) out.apart[1 + axis] = s.b.R.col(axis);
        out.apart[4] = axis_of_first;
        return out;
    }
    // Minimum distance of the bodies along a direction.
    double along(const Vec3& direction, const Kind& kind) const {
        double least = direction.dot(apart[0]);
        for (int k = 1; k < corners; ++k) least = std::min(least, direction.dot(apart[k]));
        if (corners == 0) {
            const Vec3 local(direction.dot(apart[1]), direction.dot(apart[2]), direction.dot(apart[3]));
            if (const auto* hull = std::get_if<HullRow>(&kind)) least -= hull->solid.support(local);
            if (const auto* revolved = std::get_if<RevolvedRow>(&kind)) least -= revolved->solid.support(local);
            if (const auto* line = std::get_if<CapsuleCylinderRow>(&kind))
                least -= line->solid.support(local) + std::abs(direction.dot(apart[4]));
            if (const auto* rim = std::get_if<DiskHullRow>(&kind))
                least -= rim->solid.support(local) + rim->rim * direction.cross(apart[4]).norm();
            if (const auto* rims = std::get_if<CylinderCylinderRow>(&kind))
                least -= rims->second.support(local) +
                         rims->first.support(-direction.dot(apart[4]), direction.cross(apart[4]).norm());
        }
        return least - radius;
    }
};

// Check if a width stays above `least` between two instants. The second derivative is at most 2 `parabola` in
// magnitude, per interval squared. The width then stays above its chord minus that parabola, and so does the minimum of
// several such widths.
inline bool stays_above(double from, double to, double parabola, double least) {
    const double slope = to - from - parabola;
    if (!(from > least && to > least)) return false;
    return std::abs(to - from) >= parabola || from - slope * slope / (4.0 * parabola) > least;
}

// Maximum distance of points of two bodies, for contacts of a rim or a segment with a solid, or of two rims. Infinite
// for other contacts, which do not need it.
inline double span(const Kind& kind, const Separation& at) {
    const double centers = at.apart[0].norm();
    if (const auto* line = std::get_if<CapsuleCylinderRow>(&kind)) return centers + line->half1 + line->solid.reach;
    if (const auto* rim = std::get_if<DiskHullRow>(&kind)) return centers + rim->rim + rim->solid.reach;
    if (const auto* rims = std::get_if<CylinderCylinderRow>(&kind)) return centers + rims->first.reach + rims->second.reach;
    return HUGE_VAL;
}

// Check if two bodies stay apart over `length` [s]. Along a fixed direction the distance of any two points stays above
// its chord minus the parabola of accelerations up to `bound`. Faces and edges rotate with their bodies. Along a
// direction that turns uniformly between the normals, the relative speed and distance of the points enlarge the
// parabola.
inline bool stays_apart(const Kind& kind, const Separation& a, const Separation& b, double bound, double speed,
                        double length, double least) {
    const double parabola = 0.5 * bound * length * length;
    for (const Vec3& direction : {a.normal, b.normal, Vec3((a.normal + b.normal).normalized())})
        if (stays_above(a.along(direction, kind), b.along(direction, kind), parabola, least)) return true;
    const double far = std::min(span(kind, a), span(kind, b)) + speed * length;
    if (!(far < HUGE_VAL)) return false;
    const double angle = std::atan2(a.normal.cross(b.normal).norm(), a.normal.dot(b.normal));
    const double turning = angle * (speed * length + 0.5 * angle * far);
    return stays_above(a.along(a.normal, kind), b.along(b.normal, kind), parabola + turning, least);
}

// Maximum penetration at which the direction out of contact is defined. Segments, rims and sides need a penetration
// below their rounding radius. A point in a solid is nearest to another face beyond the middle between two faces. Points
// over planes have no limit.
inline double rounded_by(const Kind& kind) {
    if (const auto* capsules = std::get_if<CapsuleCapsuleRow>(&kind)) return capsules->radius;
    if (const auto* line = std::get_if<CapsuleCylinderRow>(&kind)) return line->radius;
    if (const auto* rim = std::get_if<DiskHullRow>(&kind)) return rim->radius;
    if (const auto* rims = std::get_if<CylinderCylinderRow>(&kind)) return rims->radius;
    if (const auto* box = std::get_if<PointBoxRow>(&kind))
        return box->radius + std::min({box->half[0], box->half[1], box->half[2]});
    if (const auto* hull = std::get_if<HullRow>(&kind)) return hull->radius + hull->solid.half_width();
    if (const auto* revolved = std::get_if<RevolvedRow>(&kind)) return revolved->radius + revolved->solid.half_width();
    return HUGE_VAL;
}

// Depth to which a point may move before another face becomes the nearest. `nearest` and `next` are its distances to
// the planes of both faces, positive inside.
inline double depth_to_next_face(double nearest, double next) {
    return next > 0.0 ? next - std::max(nearest, 0.0) : 0.0;
}

// Further penetration over which the direction out of contact stays defined, for a gap of a width with `rounded_by`.
inline double depth_left(const Program& p, const Workspace& w, int gap, double width) {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    const double all = rounded_by(kind) + std::min(width, 0.0);
    const auto at = [&](const Frame& frame1, const Frame& frame2) {
        const Sides<Pose> s{{p.mechanism, w.now.terms, frame1}, {p.mechanism, w.now.terms, frame2}, 0.0};
        const Vec3 apart = s.a.x - s.b.x;
        return Vec3(s.b.R.col(0).dot(apart), s.b.R.col(1).dot(apart), s.b.R.col(2).dot(apart));
    };
    double nearest = HUGE_VAL, next = HUGE_VAL;
    const auto add = [&](double inside) {
        next = std::min(next, std::max(nearest, inside));
        nearest = std::min(nearest, inside);
    };
    double radius = 0.0;
    if (const auto* box = std::get_if<PointBoxRow>(&kind)) {
        const Vec3 x = at(box->frame1, box->frame2);
        for (int k = 0; k < 3; ++k) add(box->half[k] - std::abs(x[k]));
        radius = box->radius;
    } else if (const auto* hull = std::get_if<HullRow>(&kind)) {
        const Vec3 x = at(hull->frame1, hull->frame2);
        const auto [first, second] = hull->solid.nearest_planes(x);
        add(first);
        add(second);
        radius = hull->radius;
    } else if (const auto* revolved = std::get_if<RevolvedRow>(&kind)) {
        const Vec3 x = at(revolved->frame1, revolved->frame2);
        const Revolved& solid = revolved->solid;
        add(solid.half - std::abs(x[2]));
        add(solid.middle() + solid.widening() * x[2] - std::hypot(x[0], x[1]));
        radius = revolved->radius;
    } else {
        return all;
    }
    return std::min(all, radius + depth_to_next_face(nearest, next));
}

// Check if the gap is the lowest point of a body over a plane. Then each point of the body separately keeps its
// distance from the plane.
inline bool has_lowest_point(const Program& p, int gap) {
    return std::holds_alternative<PlaneEllipsoidRow>(p.blocks[p.gaps[gap].block].kind);
}

template <class Bytes>
void fields(Bytes& a, Separation& x) {
    for (Vec3& each : x.apart) a(each);
    a(x.corners, x.normal, x.radius);
}

}  // namespace pn
