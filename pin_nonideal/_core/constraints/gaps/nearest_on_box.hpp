// The point of a box that is nearest to the origin of frame 1. The box lies along the axes of frame 2, about its origin.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "constraints/geometry.hpp"

namespace pn {

template <class Sides>
struct NearestOnBox;

// Box about the origin of its axes, by half of its sides.
struct Box {
    static constexpr const char *gap = "box", *slip = "box_slip";
    template <class Sides>
    using Nearest = NearestOnBox<Sides>;
    Vec3 half = Vec3::Zero();
    double reach = 0.0;  // distance of a corner from the middle

    Box() = default;
    explicit Box(const Vec3& half_sides) : half(half_sides), reach(half_sides.norm()) {}
    // Return the largest component of the points along a direction in the box's axes.
    double support(const Vec3& direction) const { return half.dot(absolute(direction)); }
    // Return half of the least distance between opposite faces.
    double half_width() const { return std::min({half[0], half[1], half[2]}); }
    // Return the two least distances of a point behind the planes of the faces that are nearest to it.
    std::pair<double, double> nearest_planes(const Vec3& at) const {
        const Vec3 behind = half - absolute(at);
        const auto [first, second] = std::minmax({behind[0], behind[1]});
        return {std::min(first, behind[2]), std::min(second, std::max(first, behind[2]))};
    }

private:
    static Vec3 absolute(const Vec3& x) { return {std::abs(x[0]), std::abs(x[1]), std::abs(x[2])}; }
};

template <class Sides>
struct NearestOnBox {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec e[3];                                // axes of the box
    bool beyond[3] = {false, false, false};  // axes along which the point lies beyond the box
    Vec n;                                   // from the nearest point on the box (inside: out of the nearest face)
    Scalar distance;                         // negative inside

    PN_INLINE NearestOnBox(const Sides& s, const Box& box)
        : e{s.b.R * Vec3::UnitX(), s.b.R * Vec3::UnitY(), s.b.R * Vec3::UnitZ()}, n(), distance(0.0) {
        const Vec3& half = box.half;
        const Vec apart = s.a.x - s.b.x;
        Vec d = Vec();
        int face = 0;
        Scalar least = 0.0;
        bool lower = false;
        for (int k = 0; k < 3; ++k) {
            const Scalar at = e[k].dot(apart);
            const bool below = at < 0.0;
            const Scalar over = (below ? -at : at) - half[k];
            if (over > 0.0) {
                beyond[k] = true;
                d = d + (below ? -over : over) * e[k];
            }
            if (k == 0 || over > least) {
                face = k;
                least = over;
                lower = below;
            }
        }
        if (least > 0.0) {
            distance = d.norm();
            n = d / distance;
        } else {
            beyond[face] = true;
            distance = least;
            n = lower ? -e[face] : e[face];
        }
    }

    // Return the rate of n relative to the box, for a point with the relative velocity u. The rate is zero over a face.
    PN_INLINE Vec turning(const Vec& u) const {
        Vec along = Vec();
        int free = 0;
        for (int k = 0; k < 3; ++k) {
            if (!beyond[k]) continue;
            ++free;
            along = along + e[k].dot(u) * e[k];
        }
        if (free < 2) return Vec();
        return (along - n.dot(along) * n) / distance;
    }
};

}  // namespace pn
