// The point of a segment of body 1 that is nearest to a cylinder or cone in frame 2, and its motion.
#pragma once

#include <algorithm>
#include <cmath>

#include "constraints/geometry.hpp"
#include "constraints/gaps/nearest_on_revolved.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct SegmentSearchParameters {
    // Slope of the distance along the segment that counts as zero, due to rounding.
    double level = 1e-15;
    // Largest curvature of the distance, times half the segment, at which all points count as equally near.
    double straight = 1e-12;
    // Slope at the nearest point beyond which this point is a kink of the distance, inside the solid.
    double kink = 1e-9;
    // Maximum number of evaluations. Bisection alone ends within this number, and Newton's method takes three to eight.
    int max_samples = 100;
};

inline constexpr SegmentSearchParameters segment_search_parameters{};

template <class Sides>
struct NearestAlongLine {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    using OnSolid = NearestOnRevolved<Sides>;
    Vec middle, e;        // midpoint and direction of the segment
    Scalar part;          // position of the nearest point along e, from the midpoint
    OnSolid at;           // nearest point of the solid
    Scalar bend;          // curvature of the distance along the segment
    bool free = false;    // the point is inside the segment, at a smooth minimum

    // The distance of a point to a convex solid is convex along the segment. The slope of the distance, which is the
    // component of the normal along the segment, only grows. Newton's method finds the zero of the slope between bounds that
    // close in.
    NearestAlongLine(const Sides& s, const Revolved& solid, const Vec& x, const Vec& along, double half)
        : middle(x), e(along), part(first(s, solid, half)), at(there(s), solid), bend(0.0) {
        if (half == 0.0) return;
        Scalar low = -half, high = half, steepest = HUGE_VAL;
        bool low_seen = false, high_seen = false;
        for (int iteration = 0; iteration < segment_search_parameters.max_samples; ++iteration) {
            if (iteration > 0) at = OnSolid(there(s), solid);
            const Scalar slope = e.dot(at.n), steep = slope < 0.0 ? -slope : slope;
            bend = e.dot(at.turning(e));
            if (!(steep > segment_search_parameters.level)) break;
            const bool fast = steep < 0.5 * steepest && bend > 0.0;
            steepest = steep;
            (slope > 0.0 ? high : low) = part;
            (slope > 0.0 ? high_seen : low_seen) = true;
            if (!(high > low)) break;
            const Scalar newton = fast ? Scalar(part - slope / bend) : Scalar(slope > 0.0 ? low : high);
            // An end may be the nearest point. Between two evaluated bounds the nearest point lies inside.
            Scalar next = newton;
            if (!(newton < high)) next = high_seen ? Scalar(0.5 * (low + high)) : high;
            if (!(newton > low)) next = low_seen ? Scalar(0.5 * (low + high)) : low;
            if (!(next > part) && !(next < part)) break;
            part = next;
        }
        const Scalar slope = e.dot(at.n);
        free = part > -half && part < half && bend * half > segment_search_parameters.straight &&
               slope * slope < segment_search_parameters.kink * segment_search_parameters.kink;
        if (!free) return;
        part = part - slope / bend;
        at = OnSolid(there(s), solid);
        bend = e.dot(at.turning(e));
    }
    // Segment along z of frame 1, about its origin.
    NearestAlongLine(const Sides& s, const Revolved& solid, double half)
        : NearestAlongLine(s, solid, s.a.x, s.a.R * Vec3::UnitZ(), half) {}
    Vec place() const { return middle + part * e; }

private:
    Sides there(const Sides& s) const {
        Sides out = s;
        out.a.x = place();
        return out;
    }
    // Return the point nearest to the solid's axis. If the segment is parallel to the axis, return the middle of their
    // overlap.
    Scalar first(const Sides& s, const Revolved& solid, double half) const {
        const Vec axis = s.b.R * Vec3::UnitZ(), apart = middle - s.b.x;
        const Scalar cosine = e.dot(axis), square = 1.0 - cosine * cosine, up = apart.dot(axis);
        Scalar nearest;
        if (square > parallel_segments) {
            nearest = (up * cosine - e.dot(apart)) / square;
        } else {
            const Scalar lower = up - half > -solid.half ? Scalar(up - half) : Scalar(-solid.half);
            const Scalar upper = up + half < solid.half ? Scalar(up + half) : Scalar(solid.half);
            nearest = cosine * (0.5 * (lower + upper) - up);
        }
        return nearest > half ? Scalar(half) : nearest < -half ? Scalar(-half) : nearest;
    }
};

// Motion of the nearest point. The point slides along the segment so that the normal stays perpendicular to the segment.
template <class Sides>
struct AlongLineMotion {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec u;       // velocity of body 1 against body 2 at the nearest point of the segment
    Scalar slides;  // velocity of the nearest point along the segment
    Vec dn;      // rate of the normal
    Scalar bias;   // bias of the distance: its second rate at zero acceleration

    AlongLineMotion(const Sides& s, const NearestAlongLine<Sides>& p)
        : u(), slides(0.0), dn(), bias(0.0) {
        const Vec c = p.place();
        u = s.a.velocity(c) - s.b.velocity(c);
        const Vec turning = p.at.turning(u);
        // Rate of the slope of the distance along the segment, at a point fixed to the segment.
        const Scalar rate = turning.dot(p.e) + p.at.n.dot((s.a.omega() - s.b.omega()).cross(p.e));
        if (p.free) slides = -rate / p.bend;
        dn = s.b.omega().cross(p.at.n) + turning + slides * p.at.turning(p.e);
        const Vec du = s.a.acceleration(c) - s.b.acceleration(c) - 2.0 * s.b.omega().cross(u);
        bias = p.at.n.dot(du) + turning.dot(u) + slides * rate;
    }
};

}  // namespace pn
