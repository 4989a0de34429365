// The lowest point of an ellipsoid over a plane of frame 2. Its semiaxes lie along the axes of frame 1, about its origin;
// with one of them zero it is a disk, as the face of a wheel or of a can is, and its lowest point one of the rim.
#pragma once

#include <cmath>

#include "constraints/geometry.hpp"

namespace pn {

// Sine of the angle between a disk and the plane below which all its rim is lowest, and its middle stands for it.
constexpr double flat_disk = 1e-14;

template <class Sides>
struct LowestOnEllipsoid {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec e[3], n;        // its axes, and the normal of the plane
    Scalar part[3];     // of the normal along each axis, times the square of the semiaxis
    Scalar depth;       // of the lowest point under the middle
    Vec place;          // of it
    bool flat = false;  // no point is lower than the others

    PN_INLINE LowestOnEllipsoid(const Sides& s, const Vec3& normal, const Vec3& semiaxes)
        : e{s.a.R * Vec3::UnitX(), s.a.R * Vec3::UnitY(), s.a.R * Vec3::UnitZ()}, n(s.b.R * normal),
          part{Scalar(0.0), Scalar(0.0), Scalar(0.0)}, depth(0.0), place(s.a.x) {
        using std::sqrt;
        Scalar square = 0.0;
        for (int k = 0; k < 3; ++k) {
            const Scalar along = e[k].dot(n);
            part[k] = semiaxes[k] * semiaxes[k] * along;
            square += part[k] * along;
        }
        flat = !(square > flat_disk * flat_disk * semiaxes.squaredNorm());
        if (flat) return;
        depth = sqrt(square);
        for (int k = 0; k < 3; ++k) place = place - (part[k] / depth) * e[k];
    }

    // Its velocity: it moves on the body as the plane turns against that.
    PN_INLINE Vec velocity(const Sides& s, const Vec3& semiaxes) const {
        Vec out = s.a.velocity(place);
        if (flat) return out;
        const Vec turning = (s.b.omega() - s.a.omega()).cross(n);
        Scalar depth_rate = 0.0;
        for (int k = 0; k < 3; ++k) depth_rate += (part[k] / depth) * e[k].dot(turning);
        for (int k = 0; k < 3; ++k) {
            const Scalar part_rate = semiaxes[k] * semiaxes[k] * e[k].dot(turning);
            out = out - ((part_rate - part[k] * (depth_rate / depth)) / depth) * e[k];
        }
        return out;
    }
};

}  // namespace pn
