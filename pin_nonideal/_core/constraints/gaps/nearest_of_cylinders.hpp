// The nearest points of two cylinders, cones or disks without radius around them, and their motion. Axes are z of both
// frames, about their origins.
//
// Either one point lies on a rim of one solid and the other anywhere on the second solid (nearest_on_rim.hpp), or the
// points lie on both sides. Planes perpendicular to the normal between the nearest points prove that no points are
// nearer.
#pragma once

#include <cmath>

#include "constraints/geometry.hpp"
#include "constraints/gaps/nearest_on_rim.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

// Tolerance of the proof that no points are nearer, relative to the size of both solids.
constexpr double shown_nearest = 1e-14;

// The nearest points of two solids.
template <class Sides>
struct NearestOfCylinders {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    using Found = NearestToRevolved<Sides>;
    bool turned = false;  // the point that slides is on body 2
    Found found;
    Vec n;            // from body 2 to body 1
    Scalar distance;  // negative if one solid penetrates the side or a face of the other

    NearestOfCylinders(const Sides& s, const Revolved& first, const Revolved& second)
        : found(s, s.a.x, second), n(), distance(HUGE_VAL) {
        if (find_sides(s, first, second)) {
            take(found, false);
            return;
        }
        const Vec e1 = s.a.R * Vec3::UnitZ(), e2 = s.b.R * Vec3::UnitZ(), apart = s.a.x - s.b.x;
        const Sides other = from_second(s);
        const double faces1 = e1.dot(apart) < 0.0 ? 1.0 : -1.0, faces2 = e2.dot(apart) > 0.0 ? 1.0 : -1.0;
        for (const double end : {1.0, -1.0}) {
            if (end > 0.0 || first.half > 0.0) try_rim(s, first, end * faces1, second, false);
            if (is_nearest(apart, e1, e2, first, second)) return;
            if (end > 0.0 || second.half > 0.0) try_rim(other, second, end * faces2, first, true);
            if (is_nearest(apart, e1, e2, first, second)) return;
        }
    }
    static Sides from_second(const Sides& s) { return {s.b, s.a, s.t}; }
    Sides mover(const Sides& s) const { return turned ? from_second(s) : s; }

private:
    void take(const Found& other, bool of_second) {
        found = other;
        turned = of_second;
        distance = other.at.distance;
        n = of_second ? Vec(-other.at.n) : other.at.n;
    }
    void try_rim(const Sides& s, const Revolved& rim_solid, double end, const Revolved& other, bool of_second) {
        const NearestAroundRim<Sides> rim(s, end * rim_solid.half, end > 0.0 ? rim_solid.above : rim_solid.below);
        const Found there = rim.find(s, other);
        if (there.at.distance < distance) take(there, of_second);
    }
    // Check if planes perpendicular to the normal through both points separate the solids.
    bool is_nearest(const Vec& apart, const Vec& e1, const Vec& e2, const Revolved& first,
                              const Revolved& second) const {
        const Scalar between = n.dot(apart) - first.support(Scalar(-n.dot(e1)), Scalar(n.cross(e1).norm())) -
                               second.support(Scalar(n.dot(e2)), Scalar(n.cross(e2).norm()));
        return between > distance - shown_nearest * (first.reach + second.reach);
    }
    // Find the nearest points on crossing lines of both sides. The common normal of these lines has a known angle to both
    // axes.
    bool find_sides(const Sides& s, const Revolved& first, const Revolved& second) {
        using std::sqrt;
        if (first.half == 0.0 || second.half == 0.0) return false;
        const Vec e1 = s.a.R * Vec3::UnitZ(), e2 = s.b.R * Vec3::UnitZ(), w = e1.cross(e2), apart = s.a.x - s.b.x;
        const Scalar cosine = e1.dot(e2), square = w.dot(w);
        if (!(square > parallel_segments)) return false;
        const double up1 = -first.side_up(), up2 = second.side_up();
        const Scalar part1 = (up1 - up2 * cosine) / square, part2 = (up2 - up1 * cosine) / square;
        const Scalar left = (1.0 - part1 * up1 - part2 * up2) / square;
        if (!(left > 0.0)) return false;
        const Scalar root = sqrt(left), across = w.dot(apart) < 0.0 ? Scalar(-root) : root;
        const Vec normal = part1 * e1 + part2 * e2 + across * w;
        // Lines through the middles of both sides.
        const Vec out1 = (up1 * e1 - normal) / Scalar(first.side_out());
        const Vec out2 = (normal - up2 * e2) / Scalar(second.side_out());
        const Vec line1 = e1 + first.widening() * out1, line2 = e2 + second.widening() * out2;
        const Vec from = apart + first.middle() * out1 - second.middle() * out2;
        const Scalar a = line1.dot(line1), b = line1.dot(line2), c = line2.dot(line2);
        const Scalar d1 = line1.dot(from), d2 = line2.dot(from), det = a * c - b * b;
        if (!(det > parallel_segments * a * c)) return false;
        const Scalar z1 = (b * d2 - c * d1) / det, z2 = (a * d2 - b * d1) / det;
        if (!(z1 < first.half && z1 > -first.half && z2 < second.half && z2 > -second.half)) return false;
        const Scalar radius = first.middle() + first.widening() * z1;
        if (!(radius > 0.0)) return false;
        Found there(s, s.a.x + first.middle() * out1 + z1 * line1, second);
        there.free = 2;
        there.along[0] = e1.cross(out1);
        there.along[1] = line1 / line1.norm();
        const Vec turning0 = there.at.turning(there.along[0]), turning1 = there.at.turning(there.along[1]);
        there.bend[0] = there.along[0].dot(turning0) + first.side_out() / radius;
        there.bend[1] = there.along[1].dot(turning0);
        there.bend[2] = there.along[1].dot(turning1);
        if (!(there.bend[0] * there.bend[2] - there.bend[1] * there.bend[1] > 0.0)) return false;
        found = there;
        return true;
    }
};

// Motion of the nearest points. u, dn and drift describe body 1 relative to body 2, or the reverse if the point on body
// 2 slides.
template <class Sides>
struct CylindersMotion {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec u;       // relative velocity at the point, fixed to its body
    Vec slides;  // sliding velocity of the point along its body
    Vec dn;      // rate of the normal
    Scalar bias;  // bias of the distance: its second rate at zero acceleration

    CylindersMotion(const Sides& s, const NearestToRevolved<Sides>& p) : u(), slides(), dn(), bias(0.0) {
        const Vec& c = p.place;
        u = s.a.velocity(c) - s.b.velocity(c);
        const Vec turning = p.at.turning(u), omega = s.a.omega() - s.b.omega();
        Scalar rate[2] = {Scalar(0.0), Scalar(0.0)};  // rates of the slopes along the free directions
        for (int k = 0; k < p.free; ++k) rate[k] = turning.dot(p.along[k]) + p.at.n.dot(omega.cross(p.along[k]));
        if (p.free == 1) slides = (-rate[0] / p.bend[0]) * p.along[0];
        if (p.free == 2) {
            const Scalar det = p.bend[0] * p.bend[2] - p.bend[1] * p.bend[1];
            slides = ((p.bend[1] * rate[1] - p.bend[2] * rate[0]) / det) * p.along[0] +
                     ((p.bend[1] * rate[0] - p.bend[0] * rate[1]) / det) * p.along[1];
        }
        dn = s.b.omega().cross(p.at.n) + turning + p.at.turning(slides);
        const Vec du = s.a.acceleration(c) - s.b.acceleration(c) - 2.0 * s.b.omega().cross(u);
        bias = p.at.n.dot(du) + turning.dot(u) + slides.dot(turning) + p.at.n.dot(omega.cross(slides));
    }
};

}  // namespace pn
