// That two round bodies stay apart between two instants: whose corners lie beyond a plane at both, and accelerate no more
// than a bound, cannot have met in between, whichever of their points were the nearest.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "dynamics/workspace.hpp"

namespace pn {

// Two segments, or a point and a box, at one instant.
struct Separation {
    std::array<Vec3, 8> apart;  // from the ends or corners of the second to those of the first
    int corners = 0;            // so many of them
    Vec3 normal;                // from the nearest point of the second to that of the first
    double radius = 0.0;        // of both together

    // Nothing where the gap is that of another kind.
    static bool has(const Program& p, int gap) {
        const Kind& kind = p.blocks[p.gaps[gap].block].kind;
        return std::holds_alternative<CapsulesRow>(kind) || std::holds_alternative<BoxRow>(kind);
    }
    static Separation of(const Program& p, const Workspace& w, int gap) {
        const Kind& kind = p.blocks[p.gaps[gap].block].kind;
        const auto& [frame1, frame2] = frames(kind);
        const Sides<Pose> s{{p.mechanism, w.now.terms, *frame1}, {p.mechanism, w.now.terms, *frame2}, 0.0};
        const auto* box = std::get_if<BoxRow>(&kind);
        return box ? of(s, *box) : of(s, std::get<CapsulesRow>(kind));
    }
    static Separation of(const Sides<Pose>& s, const CapsulesRow& kind) {
        const NearestPoints<Sides<Pose>> nearest(s, kind.half1, kind.half2);
        Separation out{{}, 4, nearest.n, kind.radius};
        for (int k = 0; k < 4; ++k)
            out.apart[k] = s.a.x + (k & 1 ? kind.half1 : -kind.half1) * nearest.e1 - s.b.x -
                           (k & 2 ? kind.half2 : -kind.half2) * nearest.e2;
        return out;
    }
    static Separation of(const Sides<Pose>& s, const BoxRow& kind) {
        const NearestOnBox<Sides<Pose>> nearest(s, kind.half);
        Separation out{{}, 8, nearest.n, kind.radius};
        for (int k = 0; k < 8; ++k) {
            out.apart[k] = s.a.x - s.b.x;
            for (int axis = 0; axis < 3; ++axis)
                out.apart[k] += (k >> axis & 1 ? kind.half[axis] : -kind.half[axis]) * nearest.e[axis];
        }
        return out;
    }
    // Least distance of both from each other along a direction.
    double along(const Vec3& direction) const {
        double least = direction.dot(apart[0]);
        for (int k = 1; k < corners; ++k) least = std::min(least, direction.dot(apart[k]));
        return least - radius;
    }
};

// Along one direction the distance of any two points stays above its straight course less the parabola that accelerations
// up to `bound` may take off over `length` [s].
inline bool stays_apart(const Separation& a, const Separation& b, double bound, double length, double least) {
    const double parabola = 0.5 * bound * length * length;
    for (const Vec3& direction : {a.normal, b.normal, Vec3((a.normal + b.normal).normalized())}) {
        const double from = a.along(direction), to = b.along(direction), slope = to - from - parabola;
        if (!(from > least && to > least)) continue;
        if (std::abs(to - from) >= parabola) return true;
        if (from - slope * slope / (4.0 * parabola) > least) return true;
    }
    return false;
}

template <class Bytes>
void fields(Bytes& a, Separation& x) {
    for (Vec3& each : x.apart) a(each);
    a(x.corners, x.normal, x.radius);
}

}  // namespace pn
