// The point at which the rim of a wheel, or an ellipsoid, is lowest over a plane of frame 2. The semiaxes of the
// ellipsoid lie along the axes of frame 1, about its origin. The face of a wheel is an ellipsoid with one semiaxis zero,
// and its lowest point lies on the rim.
#pragma once

#include <cmath>

#include "constraints/geometry.hpp"

namespace pn {

// Largest sine of the angle between disk and plane at which the whole rim is lowest. The center then represents the rim.
constexpr double flat_disk = 1e-14;

template <class Sides>
struct LowestOnEllipsoid {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec e[3], n;        // axes of the ellipsoid, and normal of the plane
    Scalar part[3];     // component of the normal along each axis, times the squared semiaxis
    Scalar depth;       // depth of the lowest point below the center
    Vec place;          // the lowest point
    bool flat = false;  // no point is lower than the others

    LowestOnEllipsoid(const Sides& s, const Vec3& normal, const Vec3& semiaxes)
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

    // Return the velocity of the lowest point, which moves on the body as the plane rotates relative to the body.
    Vec velocity(const Sides& s, const Vec3& semiaxes) const {
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
