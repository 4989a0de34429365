// The nearest points of two cylinders, cones or disks without radius around them, and their motion. Axes are z of both
// frames, about their origins.
//
// Either one point lies on a rim of one solid and the other anywhere on the second solid, or the points lie on both
// sides. The solids are convex. Therefore the slope of the distance at a point of a disk excludes half of the plane of
// the disk. Planes perpendicular to the normal between the nearest points prove that no points are nearer.
#pragma once

#include <cmath>

#include "constraints/geometry.hpp"
#include "constraints/gaps/nearest_along_line.hpp"
#include "constraints/gaps/nearest_on_revolved.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

// Slope of the distance around a rim that counts as zero, due to rounding.
constexpr double level_rim = 1e-15;
// Curvature of the distance times the radius, below which all points of a rim are equally near.
constexpr double straight_rim = 1e-12;
// Slope at the nearest point beyond which this point is a kink of the distance, inside the solid.
constexpr double rim_kink = 1e-9;
// Tolerance of the proof that no points are nearer, relative to the size of both solids.
constexpr double shown_nearest = 1e-14;
// Maximum number of evaluations. Bisection alone ends within this number, and Newton's method takes three to eight.
constexpr int most_rim_looks = 80;
// Bisections over the chords of a disk, and half angle [rad] of the arc in which Newton's method continues from the result.
constexpr int most_chords = 40;
constexpr double beside_chords = 1e-3;

// Point of body 1 and the nearest point of a solid on body 2. As body 1 moves, the point slides along the first `free`
// directions of `along` and stays the nearest. It slides around a rim (1), on a side (2), or not at all (0). `bend`
// holds the second derivatives of the distance along these directions.
template <class Sides>
struct NearestToRevolved {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec place;
    NearestOnRevolved<Sides> at;
    int free = 0;
    Vec along[2];
    Scalar bend[3] = {Scalar(0.0), Scalar(0.0), Scalar(0.0)};  // entries 00, 01, 11

    NearestToRevolved(const Sides& s, const Vec& x, const Revolved& solid)
        : place(x), at(there(s, x), solid), along() {}
    static Sides there(const Sides& s, const Vec& x) {
        Sides out = s;
        out.a.x = x;
        return out;
    }
};

// The point of a rim of body 1 that is nearest to the solid, as long as no point inside the rim is nearer.
template <class Sides>
struct NearestAroundRim {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    using OnSolid = NearestOnRevolved<Sides>;
    struct Way { Scalar x, y; };  // vector from the center, in the axes of the rim
    Vec ex, ey, middle;
    double radius;

    NearestAroundRim(const Sides& s, double height, double rim)
        : ex(s.a.R * Vec3::UnitX()), ey(s.a.R * Vec3::UnitY()), middle(s.a.x + s.a.R * Vec3(0.0, 0.0, height)),
          radius(rim) {}

    // Find the nearest point. The distance only grows up its slope, so the nearest point of the whole disk lies in the
    // other half of the plane. An arc of the rim, at first half of it, closes in, and Newton steps continue inside the
    // arc. If two arcs remain, chords of the disk select one.
    NearestToRevolved<Sides> find(const Sides& s, const Revolved& solid) const {
        NearestToRevolved<Sides> out(s, middle, solid);
        if (radius == 0.0) return out;
        Way now = start(s, out.at);
        Arc arc{{now.y, -now.x}, {-now.y, now.x}};
        Scalar steepest = HUGE_VAL;
        for (int look = 0; look < most_rim_looks; ++look) {
            const OnSolid at = nearest(s, solid, now);
            const Way slope = slope_of(at);
            if (!(dot(slope, slope) > level_rim * level_rim)) break;  // the solid lies below the whole disk
            const Scalar around = cross(now, slope), outward = dot(now, slope), steep = around < 0.0 ? -around : around;
            if (!(steep > level_rim) && !(outward > 0.0)) break;
            if (!cut(arc, now, slope)) {
                now = of_chords(s, solid, now);
                arc = {turned(now, Scalar(-beside_chords)), turned(now, Scalar(beside_chords))};
                continue;
            }
            const Scalar bend = radius * curvature(at, now) - outward;
            const bool fast = steep < 0.5 * steepest && bend > 0.0;
            steepest = steep;
            const Way newton = turned(now, fast ? Scalar(-around / bend) : Scalar(0.0));
            const Way next = fast && arc.holds(newton) ? newton : arc.middle();
            if (!arc.holds(next)) break;
            now = next;
        }
        polish(s, solid, now, out);
        return out;
    }

private:
    static Scalar dot(const Way& a, const Way& b) { return a.x * b.x + a.y * b.y; }
    static Scalar cross(const Way& a, const Way& b) { return a.x * b.y - a.y * b.x; }
    static Way unit(const Way& a) {
        using std::sqrt;
        const Scalar length = sqrt(dot(a, a));
        return {a.x / length, a.y / length};
    }
    static Way turned(const Way& a, const Scalar& by) { return unit({a.x - by * a.y, a.y + by * a.x}); }
    // Arc of at most half the rim, counted around the axis.
    struct Arc {
        Way low, high;
        bool holds(const Way& way) const { return cross(low, way) > 0.0 && cross(way, high) > 0.0; }
        Way middle() const {
            const Way sum{low.x + high.x, low.y + high.y};
            return dot(sum, sum) > level_rim ? unit(sum) : Way{-low.y, low.x};
        }
    };
    // Cut the arc along the chord through a point of the arc. Returns false if a piece would remain at either end.
    static bool cut(Arc& arc, const Way& now, const Way& slope) {
        const Way down = unit({-slope.x, -slope.y});
        const Scalar part = 2.0 * dot(now, down);
        const Way across = unit({part * down.x - now.x, part * down.y - now.y});
        const bool ahead = cross(now, slope) < 0.0;
        const Arc behind{arc.low, now}, before{now, arc.high}, kept = ahead ? before : behind;
        const Arc rest = ahead ? behind : before;
        if (dot(now, slope) > 0.0 && rest.holds(across)) return false;
        arc = kept;
        if (arc.holds(across)) (ahead ? arc.high : arc.low) = across;
        return true;
    }
    // Return the direction of the nearest point of the whole disk, by bisection over the chords along `way`. The least
    // distance of a chord is convex across them.
    Way of_chords(const Sides& s, const Revolved& solid, const Way& way) const {
        const Vec along = out(way), beside = around(way);
        Way found = way;
        double low = -1.0, high = 1.0;
        for (int look = 0; look < most_chords; ++look) {
            const double part = 0.5 * (low + high), half = radius * std::sqrt(1.0 - part * part);
            const NearestAlongLine<Sides> line(s, solid, middle + radius * part * beside, along, half);
            const bool inside = half > line.part && -half < line.part;
            const Scalar ahead = line.part / radius, far = inside ? Scalar(0.0) : Scalar(part / ahead);
            // The ends of the chords lie on the rim and recede along it.
            (line.at.n.dot(beside) - far * line.at.n.dot(along) > 0.0 ? high : low) = part;
            found = {ahead * way.x - part * way.y, ahead * way.y + part * way.x};
        }
        return dot(found, found) > 0.0 ? unit(found) : way;
    }
    OnSolid nearest(const Sides& s, const Revolved& solid, const Way& way) const {
        return OnSolid(NearestToRevolved<Sides>::there(s, place(way)), solid);
    }
    Way slope_of(const OnSolid& at) const { return {at.n.dot(ex), at.n.dot(ey)}; }
    Vec place(const Way& way) const { return middle + radius * out(way); }
    Vec out(const Way& way) const { return way.x * ex + way.y * ey; }
    Vec around(const Way& way) const { return way.x * ey - way.y * ex; }
    Scalar curvature(const OnSolid& at, const Way& way) const {
        const Vec t = around(way);
        return t.dot(at.turning(t));
    }
    // Return the first direction: down the slope at the center, or toward the center of the solid if the slope vanishes
    // over a face.
    Way start(const Sides& s, const OnSolid& at) const {
        const Way slope = slope_of(at);
        if (dot(slope, slope) > level_rim) return unit({-slope.x, -slope.y});
        const Vec toward = s.b.x - middle;
        const Way there{toward.dot(ex), toward.dot(ey)};
        return dot(there, there) > 0.0 ? unit(there) : Way{Scalar(1.0), Scalar(0.0)};
    }
    void polish(const Sides& s, const Revolved& solid, Way now, NearestToRevolved<Sides>& out) const {
        for (int step = 0; step < 2; ++step) {
            out.place = place(now);
            out.along[0] = around(now);
            out.at = nearest(s, solid, now);
            out.bend[0] = curvature(out.at, now) - this->out(now).dot(out.at.n) / radius;
            const Scalar slope = out.at.n.dot(out.along[0]);
            out.free = out.bend[0] * radius > straight_rim && slope * slope < rim_kink * rim_kink ? 1 : 0;
            if (out.free == 0) return;
            if (step == 0) now = turned(now, -slope / (out.bend[0] * radius));
        }
    }
};

// The nearest points of two solids.
template <class Sides>
struct NearestOfRims {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    using Found = NearestToRevolved<Sides>;
    bool turned = false;  // the point that slides is on body 2
    Found found;
    Vec n;            // from body 2 to body 1
    Scalar distance;  // negative if one solid penetrates the side or a face of the other

    NearestOfRims(const Sides& s, const Revolved& first, const Revolved& second)
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
    void try_rim(const Sides& s, const Revolved& own, double end, const Revolved& other, bool of_second) {
        const NearestAroundRim<Sides> rim(s, end * own.half, end > 0.0 ? own.above : own.below);
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
    // Find the nearest points on crossing lines of both sides. Their common normal has a known angle to both axes.
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

// Motion of the nearest points. u, dn and drift are those of body 1 against body 2, or the reverse if the point on body
// 2 slides.
template <class Sides>
struct RimsMotion {
    using Vec = typename Sides::Vec;
    using Scalar = typename Sides::Scalar;
    Vec u;       // relative velocity at the point, fixed to its body
    Vec slides;  // sliding velocity of the point along its body
    Vec dn;      // rate of the normal
    Scalar drift;  // bias of the distance: its second rate at zero acceleration

    RimsMotion(const Sides& s, const NearestToRevolved<Sides>& p) : u(), slides(), dn(), drift(0.0) {
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
        drift = p.at.n.dot(du) + turning.dot(u) + slides.dot(turning) + p.at.n.dot(omega.cross(slides));
    }
};

}  // namespace pn
