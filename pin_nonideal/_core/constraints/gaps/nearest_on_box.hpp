// The point of a box that is nearest to the origin of frame 1. The box lies along the axes of frame 2, about its origin.
#pragma once

#include "constraints/geometry.hpp"

namespace pn {

template <class Sides>
struct NearestOnBox {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec e[3];                                // axes of the box
    bool beyond[3] = {false, false, false};  // axes along which the point lies beyond the box
    Vec n;                                   // from the nearest point on the box (inside: out of the nearest face)
    Scalar distance;                         // negative inside

    PN_INLINE NearestOnBox(const Sides& s, const Vec3& half)
        : e{s.b.R * Vec3::UnitX(), s.b.R * Vec3::UnitY(), s.b.R * Vec3::UnitZ()}, n(), distance(0.0) {
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
