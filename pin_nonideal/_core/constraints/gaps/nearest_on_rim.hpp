// The point of a rim of body 1 that is nearest to a cylinder, cone or disk on body 2. The rim lies across z of frame 1.
//
// Both are convex. Therefore the slope of the distance at a point of the disk inside the rim excludes half of the plane
// of the disk.
#pragma once

#include <cmath>

#include "constraints/geometry.hpp"
#include "constraints/gaps/nearest_along_line.hpp"
#include "constraints/gaps/nearest_on_revolved.hpp"

namespace pn {

struct RimSearchParameters {
    // Slope of the distance around a rim that counts as zero, due to rounding.
    double level = 1e-15;
    // Largest curvature of the distance, times the radius, at which all points of a rim count as equally near.
    double straight = 1e-12;
    // Slope at the nearest point beyond which this point is a kink of the distance, inside the solid.
    double kink = 1e-9;
    // Maximum number of evaluations. Bisection alone ends within this number, and Newton's method takes three to eight.
    int max_samples = 80;
    int max_chord_bisections = 40;  // bisections over the chords of a disk
    double beside_chords = 1e-3;    // half angle [rad] of the arc in which Newton's method continues from their result
};

inline constexpr RimSearchParameters rim_search_parameters{};

// Point of body 1 and the nearest point of a solid on body 2. As body 1 moves, the point slides along the first `free`
// directions of `along` and stays the nearest. The point slides around a rim (1), on a side (2), or not at all (0). `bend`
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
    struct Direction { Scalar x, y; };  // vector from the center, in the axes of the rim
    Vec ex, ey, middle;
    double radius;

    NearestAroundRim(const Sides& s, double height, double rim)
        : ex(s.a.R * Vec3::UnitX()), ey(s.a.R * Vec3::UnitY()), middle(s.a.x + s.a.R * Vec3(0.0, 0.0, height)),
          radius(rim) {}

    // Find the nearest point. The distance only grows up its slope, so the nearest point of the whole disk lies in the
    // other half of the plane. An arc of the rim, at first half of it, closes in, and Newton steps continue inside the
    // arc. If two arcs remain, chords of the disk select one, once: the distance is even around a rim that is coaxial
    // with the solid, and no chord is then better than another.
    NearestToRevolved<Sides> find(const Sides& s, const Revolved& solid) const {
        NearestToRevolved<Sides> out(s, middle, solid);
        if (radius == 0.0) return out;
        Direction now = start(s, out.at);
        Arc arc{{now.y, -now.x}, {-now.y, now.x}};
        Scalar steepest = HUGE_VAL;
        bool selected = false;
        for (int iteration = 0; iteration < rim_search_parameters.max_samples; ++iteration) {
            const OnSolid at = nearest(s, solid, now);
            const Direction slope = slope_of(at);
            if (!(dot(slope, slope) > rim_search_parameters.level * rim_search_parameters.level))
                break;  // the solid lies below the whole disk
            const Scalar around = cross(now, slope), outward = dot(now, slope), steep = around < 0.0 ? -around : around;
            if (!(steep > rim_search_parameters.level) && (selected || !(outward > 0.0))) break;
            if (!cut(arc, now, slope) && !selected) {
                selected = true;
                now = of_chords(s, solid, now);
                arc = {turned(now, Scalar(-rim_search_parameters.beside_chords)),
                       turned(now, Scalar(rim_search_parameters.beside_chords))};
                continue;
            }
            const Scalar bend = radius * curvature(at, now) - outward;
            const bool fast = steep < 0.5 * steepest && bend > 0.0;
            steepest = steep;
            const Direction newton = turned(now, fast ? Scalar(-around / bend) : Scalar(0.0));
            const Direction next = fast && arc.holds(newton) ? newton : arc.middle();
            if (!arc.holds(next)) break;
            now = next;
        }
        polish(s, solid, now, out);
        return out;
    }

private:
    static Scalar dot(const Direction& a, const Direction& b) { return a.x * b.x + a.y * b.y; }
    static Scalar cross(const Direction& a, const Direction& b) { return a.x * b.y - a.y * b.x; }
    static Direction unit(const Direction& a) {
        using std::sqrt;
        const Scalar length = sqrt(dot(a, a));
        return {a.x / length, a.y / length};
    }
    static Direction turned(const Direction& a, const Scalar& by) { return unit({a.x - by * a.y, a.y + by * a.x}); }
    // Arc of at most half the rim, counted around the axis.
    struct Arc {
        Direction low, high;
        bool holds(const Direction& direction) const { return cross(low, direction) > 0.0 && cross(direction, high) > 0.0; }
        Direction middle() const {
            const Direction sum{low.x + high.x, low.y + high.y};
            return dot(sum, sum) > rim_search_parameters.level ? unit(sum) : Direction{-low.y, low.x};
        }
    };
    // Cut the arc along the chord through a point of the arc, and keep the end down the slope. Return false if a piece
    // would remain at the other end too.
    static bool cut(Arc& arc, const Direction& now, const Direction& slope) {
        const Direction down = unit({-slope.x, -slope.y});
        const Scalar part = 2.0 * dot(now, down);
        const Direction across = unit({part * down.x - now.x, part * down.y - now.y});
        const bool ahead = cross(now, slope) < 0.0;
        const Arc behind{arc.low, now}, before{now, arc.high}, kept = ahead ? before : behind;
        const Arc rest = ahead ? behind : before;
        arc = kept;
        if (arc.holds(across)) (ahead ? arc.high : arc.low) = across;
        return !(dot(now, slope) > 0.0 && rest.holds(across));
    }
    // Return the direction of the nearest point of the whole disk, by bisection over the chords along `direction`. The least
    // distance of a chord is convex across the chords.
    Direction of_chords(const Sides& s, const Revolved& solid, const Direction& direction) const {
        const Vec along = out(direction), beside = around(direction);
        Direction found = direction;
        double low = -1.0, high = 1.0;
        for (int iteration = 0; iteration < rim_search_parameters.max_chord_bisections; ++iteration) {
            const double part = 0.5 * (low + high), half = radius * std::sqrt(1.0 - part * part);
            const NearestAlongLine<Sides> line(s, solid, middle + radius * part * beside, along, half);
            const bool inside = half > line.part && -half < line.part;
            const Scalar ahead = line.part / radius, far = inside ? Scalar(0.0) : Scalar(part / ahead);
            // The ends of the chords lie on the rim and recede along it.
            (line.at.n.dot(beside) - far * line.at.n.dot(along) > 0.0 ? high : low) = part;
            found = {ahead * direction.x - part * direction.y, ahead * direction.y + part * direction.x};
        }
        return dot(found, found) > 0.0 ? unit(found) : direction;
    }
    OnSolid nearest(const Sides& s, const Revolved& solid, const Direction& direction) const {
        return OnSolid(NearestToRevolved<Sides>::there(s, place(direction)), solid);
    }
    Direction slope_of(const OnSolid& at) const { return {at.n.dot(ex), at.n.dot(ey)}; }
    Vec place(const Direction& direction) const { return middle + radius * out(direction); }
    Vec out(const Direction& direction) const { return direction.x * ex + direction.y * ey; }
    Vec around(const Direction& direction) const { return direction.x * ey - direction.y * ex; }
    Scalar curvature(const OnSolid& at, const Direction& direction) const {
        const Vec t = around(direction);
        return t.dot(at.turning(t));
    }
    // Return the first direction: down the slope at the center, or toward the center of the solid if the slope vanishes
    // over a face.
    Direction start(const Sides& s, const OnSolid& at) const {
        const Direction slope = slope_of(at);
        if (dot(slope, slope) > rim_search_parameters.level) return unit({-slope.x, -slope.y});
        const Vec toward = s.b.x - middle;
        const Direction there{toward.dot(ex), toward.dot(ey)};
        return dot(there, there) > 0.0 ? unit(there) : Direction{Scalar(1.0), Scalar(0.0)};
    }
    void polish(const Sides& s, const Revolved& solid, Direction now, NearestToRevolved<Sides>& out) const {
        for (int step = 0; step < 2; ++step) {
            out.place = place(now);
            out.along[0] = around(now);
            out.at = nearest(s, solid, now);
            out.bend[0] = curvature(out.at, now) - this->out(now).dot(out.at.n) / radius;
            const Scalar slope = out.at.n.dot(out.along[0]);
            out.free = out.bend[0] * radius > rim_search_parameters.straight &&
                               slope * slope < rim_search_parameters.kink * rim_search_parameters.kink
                           ? 1
                           : 0;
            if (out.free == 0) return;
            if (step == 0) now = turned(now, -slope / (out.bend[0] * radius));
        }
    }
};

}  // namespace pn
