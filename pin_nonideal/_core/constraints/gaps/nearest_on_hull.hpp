// The point of a convex hull that is nearest to the origin of frame 1. The hull lies in the axes of frame 2.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "constraints/geometry.hpp"

namespace pn {

template <class Sides>
struct NearestOnHull;

// Largest cosine of the angle between two faces that count as faces of different directions.
constexpr double other_direction = 0.7;

// Convex solid with flat faces: its corners, the planes of its faces, and its edges, each between two faces.
struct Hull {
    static constexpr const char *gap = "hull", *slip = "hull_slip";
    template <class Sides>
    using Nearest = NearestOnHull<Sides>;
    struct Edge {
        int from = 0, to = 0, face1 = 0, face2 = 0;
    };
    struct Face {
        Vec3 normal = Vec3::Zero();  // outward
        double offset = 0.0;         // distance of its plane from the origin, along the normal
        std::vector<Vec3> sides;     // normals of its edges, in its plane and outward
        std::vector<double> ends;    // offsets of its edges along these normals
    };
    std::vector<Vec3> points;
    std::vector<Face> faces;
    std::vector<Edge> edges;
    double reach = 0.0;  // distance of the farthest corner from the origin

    Hull() = default;
    // Each plane is four numbers, normal and offset. Each edge is two corners and the two faces that meet there.
    Hull(const std::vector<Vec3>& corners, const std::vector<double>& planes, const std::vector<int>& meetings)
        : points(corners), faces(planes.size() / 4) {
        for (size_t f = 0; f < faces.size(); ++f) {
            faces[f].normal = {planes[4 * f], planes[4 * f + 1], planes[4 * f + 2]};
            faces[f].offset = planes[4 * f + 3];
        }
        for (size_t i = 0; i + 3 < meetings.size(); i += 4) {
            const Edge edge{meetings[i], meetings[i + 1], meetings[i + 2], meetings[i + 3]};
            edges.push_back(edge);
            add_side(edge, edge.face1, edge.face2);
            add_side(edge, edge.face2, edge.face1);
        }
        for (const Vec3& point : points) reach = std::max(reach, point.norm());
    }
    // Return the largest component of the points along a direction in the hull's axes.
    double support(const Vec3& direction) const {
        double support = direction.dot(points[0]);
        for (const Vec3& point : points) support = std::max(support, direction.dot(point));
        return support;
    }

    // Return half of the least distance between a face and the points behind it.
    double half_width() const {
        double least = HUGE_VAL;
        for (const Face& face : faces) least = std::min(least, 0.5 * (face.offset + support(-face.normal)));
        return least;
    }

    // Return the distances of a point behind the plane of its nearest face, and of the next face of another direction.
    std::pair<double, double> nearest_planes(const Vec3& at) const {
        size_t first = 0;
        const auto behind = [&](size_t f) { return faces[f].offset - faces[f].normal.dot(at); };
        for (size_t f = 1; f < faces.size(); ++f)
            if (behind(f) < behind(first)) first = f;
        double next = HUGE_VAL;
        for (size_t f = 0; f < faces.size(); ++f)
            if (faces[f].normal.dot(faces[first].normal) < other_direction) next = std::min(next, behind(f));
        return {behind(first), next};
    }

    template <class Vec>
    bool holds(const Vec& at) const {
        for (const Face& face : faces)
            if (product(face.normal, at) > face.offset) return false;
        return true;
    }
    template <class Vec>
    static auto product(const Vec3& a, const Vec& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
    // Check if a point outside a face lies over the face.
    template <class Vec>
    static bool stands_over(const Vec& at, const Face& face) {
        for (size_t k = 0; k < face.sides.size(); ++k)
            if (product(face.sides[k], at) > face.ends[k]) return false;
        return true;
    }

private:
    // The other face slopes away beyond the edge, so its normal has an outward component at the edge.
    void add_side(const Edge& edge, int face, int other) {
        Vec3 side = faces[face].normal.cross(points[edge.to] - points[edge.from]).normalized();
        if (side.dot(faces[other].normal) < 0.0) side = -side;
        faces[face].sides.push_back(side);
        faces[face].ends.push_back(side.dot(points[edge.from]));
    }
};

template <class Sides>
struct NearestOnHull {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec n;                                   // from the nearest point on the hull (inside: out of the nearest face)
    Vec along;                               // direction of the nearest edge
    bool on_face = false, on_edge = false;  // location of the nearest point (neither: a corner)
    Scalar distance;                         // negative inside

    NearestOnHull(const Sides& s, const Hull& hull) : n(), along(), distance(0.0) {
        const Vec e[3] = {s.b.R * Vec3::UnitX(), s.b.R * Vec3::UnitY(), s.b.R * Vec3::UnitZ()};
        const Vec apart = s.a.x - s.b.x;
        const Vec at(e[0].dot(apart), e[1].dot(apart), e[2].dot(apart));
        if (!find_face(at, hull)) find_edge(at, hull);
        n = turned(e, n);
        along = turned(e, along);
    }

    // Return the rate of n relative to the hull, for a point with the relative velocity u. The rate is zero over a face.
    Vec turning(const Vec& u) const {
        if (on_face) return Vec();
        const Vec free = on_edge ? Vec(u - along.dot(u) * along) : u;
        return (free - n.dot(free) * n) / distance;
    }

private:
    static Scalar product(const Vec3& a, const Vec& b) { return Hull::product(a, b); }
    static Vec turned(const Vec (&e)[3], const Vec& x) { return x[0] * e[0] + x[1] * e[1] + x[2] * e[2]; }

    // Find the face below the point. Inside the hull, find the nearest face.
    bool find_face(const Vec& at, const Hull& hull) {
        int least = -1;
        bool outside = false;
        for (size_t f = 0; f < hull.faces.size() && !on_face; ++f) {
            const Scalar over = product(hull.faces[f].normal, at) - hull.faces[f].offset;
            const bool beyond = over > 0.0;
            outside = outside || beyond;
            if (beyond ? Hull::stands_over(at, hull.faces[f]) : !outside && (least < 0 || over > distance)) {
                least = static_cast<int>(f);
                distance = over;
                on_face = beyond;
            }
        }
        if (outside && !on_face) return false;
        on_face = true;
        n = Vec(hull.faces[least].normal);
        return true;
    }
    void find_edge(const Vec& at, const Hull& hull) {
        for (const Hull::Edge& edge : hull.edges) {
            const Vec3 &from = hull.points[edge.from], &to = hull.points[edge.to];
            const double length = (to - from).norm();
            const Vec3 direction = (to - from) / length;
            const Vec beyond = at - Vec(from);
            const Scalar part = product(direction, beyond);
            const bool before = part < 0.0, behind = part > length;
            const Vec d = before ? beyond : behind ? Vec(at - Vec(to)) : Vec(beyond - part * Vec(direction));
            const Scalar away = d.norm();
            if (&edge != &hull.edges[0] && !(away < distance)) continue;
            distance = away;
            n = d / away;
            on_edge = !before && !behind;
            along = Vec(direction);
        }
    }
};

}  // namespace pn
