// The nearest points of two segments, one on each body, their motion, and the directions of a contact at these points.
// Spheres and capsules are segments with a radius. A point is a segment without length and radius.
#pragma once

#include <cmath>

#include "constraints/geometry.hpp"

namespace pn {

// Largest squared sine of the angle between segments that count as parallel.
constexpr double parallel_segments = 1e-12;

// Segments x + s e, |s| <= half, of frames 1 and 2 along their z axes. If both points lie inside their segments, n follows
// from the directions of the lines. The difference of points that nearly coincide would be inaccurate.
template <class Sides>
struct NearestPoints {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec e1, e2, c1, c2;        // axes and nearest points
    Vec n;                     // from the second point to the first
    Scalar distance;
    bool free1 = false, free2 = false;  // the point lies inside its segment, not at an end
    Scalar sine = 0.0;  // e1 x e2 = sine n if n is perpendicular to both lines, else 0

    PN_INLINE NearestPoints(const Sides& s, double half1, double half2)
        : e1(s.a.R * Vec3::UnitZ()), e2(s.b.R * Vec3::UnitZ()) {
        const Vec apart = s.a.x - s.b.x;
        const Scalar along1 = e1.dot(apart), along2 = e2.dot(apart), cosine = e1.dot(e2);
        const Scalar square = 1.0 - cosine * cosine;
        Scalar s1 = 0.0, s2 = 0.0;
        if (half1 > 0.0 && half2 > 0.0 && square > parallel_segments)
            s1 = clamped((cosine * along2 - along1) / square, half1);
        else if (half1 > 0.0 && half2 == 0.0)
            s1 = clamped(-along1, half1);
        s2 = clamped(along2 + s1 * cosine, half2);
        s1 = clamped(s2 * cosine - along1, half1);
        free1 = s1 < half1 && s1 > -half1;
        free2 = s2 < half2 && s2 > -half2;
        c1 = s.a.x + s1 * e1;
        c2 = s.b.x + s2 * e2;
        const Vec d = c1 - c2;
        distance = d.norm();
        if (free1 && free2 && square > parallel_segments) {
            const Vec across = e1.cross(e2);
            sine = d.dot(across) < 0.0 ? -across.norm() : across.norm();
            n = Vec(across / sine);
        } else {
            n = distance > 0.0 ? Vec(d / distance) : Vec(Vec3::UnitZ());
        }
    }

private:
    static PN_INLINE Scalar clamped(const Scalar& x, double half) {
        return x > half ? Scalar(half) : x < -half ? Scalar(-half) : x;
    }
};

// Motion of the nearest points. The points slide so that the line between them stays perpendicular to each segment with a
// free point.
template <class Sides>
struct NearestMotion {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec u;             // velocity of body 1 at c1 against body 2 at c2
    Vec along1, along2;  // velocities of the nearest points along their segments
    Vec dn;            // rate of n

    PN_INLINE NearestMotion(const Sides& s, const NearestPoints<Sides>& p)
        : u(s.a.velocity(p.c1) - s.b.velocity(p.c2)), along1(), along2(), dn() {
        const Vec d = p.distance * p.n;
        const Scalar cosine = p.e1.dot(p.e2);
        const Scalar r1 = s.a.omega().cross(p.e1).dot(d) + p.e1.dot(u);
        const Scalar r2 = s.b.omega().cross(p.e2).dot(d) + p.e2.dot(u);
        // r1 + s1' - s2' cosine = 0 and r2 + s1' cosine - s2' = 0, each if its point is free.
        Scalar rate1 = 0.0, rate2 = 0.0;
        const Scalar square = 1.0 - cosine * cosine;
        if (p.free1 && p.free2 && square > parallel_segments) {
            rate1 = (cosine * r2 - r1) / square;
            rate2 = r2 + cosine * rate1;
        } else if (p.free1) {
            rate1 = -r1;
        } else if (p.free2) {
            rate2 = r2;
        }
        along1 = rate1 * p.e1;
        along2 = rate2 * p.e2;
        if (p.sine != 0.0) {
            const Vec turn = s.a.omega().cross(p.e1).cross(p.e2) + p.e1.cross(s.b.omega().cross(p.e2));
            dn = (turn - p.n.dot(turn) * p.n) / p.sine;
        } else if (p.distance > 0.0) {
            const Vec dd = u + along1 - along2;
            dn = (dd - p.n.dot(dd) * p.n) / p.distance;
        }
    }
};

// Directions along a contact with a normal n that is free to turn. The directions are fixed in body 2 and rotated the
// shortest way from a direction `pole` of body 2 to n. The directions jump only at n = -pole.
template <class Sides>
struct TurningTangents {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec t[2], dt[2];

    // dn: rate of n.
    PN_INLINE TurningTangents(const Sides& s, const Vec& n, const Vec& dn) {
        const Vec3 pole(0.48, 0.6, 0.64);
        const Vec3 first = Vec3(pole[1], -pole[0], 0.0) / std::sqrt(pole[0] * pole[0] + pole[1] * pole[1]);
        const Vec3 axes[2] = {first, pole.cross(first)};
        const Vec z = s.b.R * pole, dz = s.b.omega().cross(z), sum = n + z, dsum = dn + dz;
        const Scalar down = 1.0 + n.dot(z), ddown = dn.dot(z) + n.dot(dz);
        for (int k = 0; k < 2; ++k) {
            const Vec a = s.b.R * axes[k], da = s.b.omega().cross(a);
            const Scalar part = n.dot(a), dpart = dn.dot(a) + n.dot(da);
            t[k] = a - (part / down) * sum;
            dt[k] = da - (dpart / down - part * ddown / (down * down)) * sum - (part / down) * dsum;
        }
    }
};

// Set the rows of sliding along turning directions, at a contact point that moves with the rate `moves`.
template <class Sides, class Out>
PN_INLINE void slide(const Sides& s, Out& out, const TurningTangents<Sides>& along, const typename Sides::Vec& contact,
                     const typename Sides::Vec& moves) {
    const auto va = s.a.velocity(contact), vb = s.b.velocity(contact), u = va - vb;
    const auto du = s.a.acceleration(contact) + s.a.omega().cross(moves - va) - s.b.acceleration(contact) -
                    s.b.omega().cross(moves - vb);
    for (int k = 0; k < 2; ++k) {
        out.rate[k] = along.t[k].dot(u);
        out.bias[k] = along.t[k].dot(du) + along.dt[k].dot(u);
    }
}

}  // namespace pn
