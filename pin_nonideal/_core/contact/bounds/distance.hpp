// Proof that two bodies stay apart between two instants. One body is beyond a plane at both instants, and accelerations are
// bounded. Then no points can meet in between, whichever points are nearest.
#pragma once

#include <algorithm>
#include <cmath>

#include "dynamics/workspace.hpp"

namespace pn {

// Two shapes at one instant.
struct Separation {
    Vec3 centers;        // from frame 2 to frame 1
    Mat3 axes1, axes2;   // of both frames
    Vec3 normal;         // from the nearest point of shape 2 to the nearest point of shape 1
    double radius = 0.0;  // sum of both radii

    // Check if the gap is between two shapes.
    static bool has(const Program& p, int gap) {
        return visit_as<ShapeGap>(p.blocks[p.gaps[gap].block].kind, [](const auto&) {});
    }
    static Separation of(const Program& p, const Workspace& w, int gap) {
        Separation out;
        visit_as<ShapeGap>(p.blocks[p.gaps[gap].block].kind, [&](const auto& k) {
            const Sides<Pose> s{{p.mechanism, w.now.terms, k.frame1}, {p.mechanism, w.now.terms, k.frame2}, 0.0};
            out = {s.a.x - s.b.x, s.a.R, s.b.R, k.normal(s), k.radius};
        });
        return out;
    }
    // Minimum distance of the bodies along a direction.
    double along(const Vec3& direction, const Kind& kind) const {
        double least = direction.dot(centers) - radius;
        visit_as<ShapeGap>(kind, [&](const auto& k) {
            least -= k.support1(-transpose_times(axes1, direction)) + k.support2(transpose_times(axes2, direction));
        });
        return least;
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

// Maximum distance of points of two bodies.
inline double span(const Kind& kind, const Separation& at) {
    double span = HUGE_VAL;
    visit_as<ShapeGap>(kind, [&](const auto& k) { span = at.centers.norm() + k.extent1() + k.extent2(); });
    return span;
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
    const double angle = std::atan2(a.normal.cross(b.normal).norm(), a.normal.dot(b.normal));
    const double turning = angle * (speed * length + 0.5 * angle * far);
    return stays_above(a.along(a.normal, kind), b.along(b.normal, kind), parabola + turning, least);
}

// Maximum penetration at which the direction out of contact is defined. Points over planes have no limit.
inline double rounded_by(const Kind& kind) {
    double depth = HUGE_VAL;
    visit_as<ShapeGap>(kind, [&](const auto& k) { depth = k.max_depth(); });
    return depth;
}

// Check if a gap is between lines, such as edges and rims. The radius of the rounded edges bounds the penetration of
// such a gap.
inline bool is_between_lines(const Kind& kind) {
    bool is_line = false;
    visit_as<ShapeGap>(kind, [&](const auto& k) { is_line = k.max_depth() <= k.radius; });
    return is_line;
}

// Maximum penetration at which the direction out of contact is defined, at the state of the workspace. Only a rim depends on
// the state: the maximum is larger over a face than beside an edge.
inline double max_depth(const Program& p, const Workspace& w, int gap) {
    const Kind& kind = p.blocks[p.gaps[gap].block].kind;
    const auto* rim = std::get_if<DiskHullRow>(&kind);
    if (!rim) return rounded_by(kind);
    const Terms& terms = w.now.terms;
    return rim->max_depth(Sides<Pose>{{p.mechanism, terms, rim->frame1}, {p.mechanism, terms, rim->frame2}, 0.0});
}

// Further penetration up to which the direction out of contact stays defined, for a gap of this width.
inline double depth_left(const Program& p, const Workspace& w, int gap, double width) {
    double depth = HUGE_VAL;
    visit_as<ShapeGap>(p.blocks[p.gaps[gap].block].kind, [&](const auto& k) {
        const Pose one(p.mechanism, w.now.terms, k.frame1), other(p.mechanism, w.now.terms, k.frame2);
        const Vec3 at = transpose_times(other.R, one.x - other.x);
        depth = std::min(max_depth(p, w, gap) + std::min(width, 0.0), k.depth_to_next_face(at));
    });
    return depth;
}

// Check if the gap is the lowest point of a body over a plane. Then each point of the body separately keeps its
// distance from the plane.
inline bool has_lowest_point(const Program& p, int gap) {
    return std::holds_alternative<PlaneRimOrEllipsoidRow>(p.blocks[p.gaps[gap].block].kind);
}

template <class Bytes>
void fields(Bytes& a, Separation& x) {
    for (int k = 0; k < 3; ++k) a(x.axes1.col(k), x.axes2.col(k));
    a(x.centers, x.normal, x.radius);
}

}  // namespace pn
