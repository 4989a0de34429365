// The point of a disk that is nearest to a convex hull. If the disk stands over a face, this is its lowest point on the
// rim (lowest_on_rim_or_ellipsoid.hpp). Otherwise it is the point that faces the nearest edge. The disk lies across z of
// frame 1, about its origin. The hull lies in frame 2.
#pragma once

#include <optional>

#include "constraints/geometry.hpp"
#include "constraints/gaps/lowest_on_rim_or_ellipsoid.hpp"
#include "constraints/gaps/nearest_along_line.hpp"
#include "constraints/gaps/nearest_on_hull.hpp"

namespace pn {

template <class Sides>
struct NearestOnDisk {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    using Lowest = LowestOnEllipsoid<Sides>;
    using Line = NearestAlongLine<Sides>;
    Vec n;            // from the hull to the disk
    Vec place;        // nearest point of the disk
    Scalar distance;  // negative if the disk penetrates a face
    std::optional<Lowest> lowest;  // set over a face
    std::optional<Line> line;      // else set: nearest edge, with the disk as a cylinder of zero length

    NearestOnDisk(const Sides& s, const Hull& hull, double rim) : n(), place(), distance(0.0) {
        if (!find_face(s, hull, rim)) find_edge(s, hull, rim);
    }
    static Sides from_hull(const Sides& s) { return {s.b, s.a, s.t}; }

private:
    bool find_face(const Sides& s, const Hull& hull, double rim) {
        const Vec3 semiaxes(rim, rim, 0.0);
        for (const Hull::Face& face : hull.faces) {
            const Lowest there(s, face.normal, semiaxes);
            const Vec apart = there.place - s.b.x;
            const Scalar over = there.n.dot(apart) - face.offset;
            const Vec at(s.b.R.col(0).dot(apart), s.b.R.col(1).dot(apart), s.b.R.col(2).dot(apart));
            if (over > 0.0 ? !Hull::stands_over(at, face) : !hull.holds(at) || (lowest && !(over > distance))) continue;
            lowest.emplace(there);
            distance = over;
            n = there.n;
            place = there.place;
            if (over > 0.0) return true;
        }
        return lowest.has_value();
    }
    void find_edge(const Sides& s, const Hull& hull, double rim) {
        const Revolved disk(0.0, rim, rim);
        const Sides turned = from_hull(s);
        for (const Hull::Edge& edge : hull.edges) {
            const Vec3 way = hull.points[edge.to] - hull.points[edge.from];
            const double half = 0.5 * way.norm();
            const Vec middle = s.b.x + s.b.R * Vec3(hull.points[edge.from] + 0.5 * way);
            const Vec along = s.b.R * Vec3(way / (2.0 * half)), apart = s.a.x - middle;
            // Lower bound: distance of the edge to the disk's center, less the radius.
            const Scalar part = along.dot(apart);
            const Scalar beside = part > half ? Scalar(half) : part < -half ? Scalar(-half) : part;
            if (line && Vec(apart - beside * along).norm() - rim > distance) continue;
            const Line there(turned, disk, middle, along, half);
            if (line && !(there.at.distance < distance)) continue;
            line.emplace(there);
            distance = there.at.distance;
        }
        n = -line->at.n;
        place = line->place() + distance * n;
    }
};

}  // namespace pn
