// The point of a cylinder or cone that is nearest to the origin of frame 1. The axis of the solid is z of frame 2, and the
// middle of the solid is the origin. The radii of its faces may differ, and one may be zero. A solid without length is a
// disk.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "constraints/geometry.hpp"

namespace pn {

template <class Sides>
struct NearestOnRevolved;

struct Revolved {
    static constexpr const char *gap = "revolved", *slip = "revolved_slip";
    template <class Sides>
    using Nearest = NearestOnRevolved<Sides>;
    double half = 0.0, below = 0.0, above = 0.0;  // half the length, and the radii of both faces
    double reach = 0.0;                           // distance of the farther rim from the middle

    Revolved() = default;
    Revolved(double length_half, double radius_below, double radius_above)
        : half(length_half), below(radius_below), above(radius_above),
          reach(std::hypot(half, std::max(below, above))) {}
    // Return the largest component of the points along a direction in the solid's axes.
    double support(const Vec3& direction) const {
        return support(direction[2], std::hypot(direction[0], direction[1]));
    }
    // Return this component for a direction with the given components along the axis and across it.
    template <class Scalar>
    Scalar support(const Scalar& along, const Scalar& across) const {
        const Scalar high = half * along + above * across, low = below * across - half * along;
        return high > low ? high : low;
    }
    // Return half of the least distance between opposite surfaces, for a cone in its middle.
    double half_width() const { return std::min(half, middle()); }
    // Return the distances of a point behind the nearest face and behind the side, the smaller one first.
    std::pair<double, double> nearest_planes(const Vec3& at) const {
        return std::minmax({half - std::abs(at[2]), middle() + widening() * at[2] - std::hypot(at[0], at[1])});
    }
    // Side of the solid: components of its normal away from the axis and along it, radius in the middle, growth along
    // the axis.
    double side_out() const { return 2.0 * half / std::hypot(2.0 * half, below - above); }
    double side_up() const { return (below - above) / std::hypot(2.0 * half, below - above); }
    double middle() const { return 0.5 * (below + above); }
    double widening() const { return 0.5 * (above - below) / half; }
};

template <class Sides>
struct NearestOnRevolved {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec axis, out;            // along the axis, and away from it toward the point
    Vec n;                    // from the nearest point on the solid (inside: out of the nearest face)
    Scalar distance;          // negative inside
    bool on_rim = false;      // the nearest point is on a rim, or at the tip
    Scalar turns = Scalar(0.0);  // rate of n about the axis, per velocity of the point around the axis

    NearestOnRevolved(const Sides& s, const Revolved& solid)
        : axis(s.b.R * Vec3::UnitZ()), out(s.b.R * Vec3::UnitX()), n(), distance(0.0) {
        const double slope = std::hypot(2.0 * solid.half, solid.below - solid.above);
        const bool disk = slope == 0.0;
        const double side_out = disk ? 1.0 : 2.0 * solid.half / slope;
        const double side_up = disk ? 0.0 : (solid.below - solid.above) / slope;
        const Vec apart = s.a.x - s.b.x;
        const Scalar z = axis.dot(apart);
        const Vec across = apart - z * axis;
        const Scalar r = across.norm();
        if (r > 0.0) out = across / r;
        const Scalar over = z - solid.half, under = -z - solid.half;
        const Scalar beside = side_out * (r - solid.below) + side_up * (z + solid.half);
        const Scalar along = side_out * (z + solid.half) - side_up * (r - solid.below);
        const bool inside = !(over > 0.0) && !(under > 0.0) && !(beside > 0.0);
        if (inside ? over >= under && over >= beside : over > 0.0 && r <= solid.above) {
            distance = over;
            n = axis;
        } else if (inside ? under >= beside : under > 0.0 && r <= solid.below) {
            distance = under;
            n = -axis;
        } else if (inside || (!disk && beside > 0.0 && along >= 0.0 && along <= slope)) {
            distance = beside;
            n = side_out * out + side_up * axis;
            if (r > 0.0) turns = side_out / r;
        } else {
            find_rim(solid, r, z);
        }
    }

    // Return the rate of n relative to the solid, for a point with the relative velocity u.
    Vec turning(const Vec& u) const {
        const Vec around = u - out.dot(u) * out - axis.dot(u) * axis;
        Vec sum = turns * around;
        if (!on_rim) return sum;
        const Vec free = u - around;
        return sum + (free - n.dot(free) * n) / distance;
    }

private:
    void find_rim(const Revolved& solid, const Scalar& r, const Scalar& z) {
        on_rim = true;
        for (const double end : {solid.half, -solid.half}) {
            const double radius = end > 0.0 ? solid.above : solid.below;
            const Vec d = (r - radius) * out + (z - end) * axis;
            const Scalar away = d.norm();
            if (end < 0.0 && !(away < distance)) continue;
            distance = away;
            n = away > 0.0 ? Vec(d / away) : out;
            turns = Scalar(1.0) / away;
            if (radius > 0.0) turns = (1.0 - radius / r) / away;
        }
    }
};

}  // namespace pn
