// Directions of friction: sliding of the rim of a cylinder or cone along a convex hull.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_disk.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct DiskHullSlipRows : ContactSlip {
    static constexpr const char* name = "disk_hull_slip";

    SharedFrame frame1, frame2;
    Hull solid;
    double rim;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &DiskHullSlipRows::frame1}, Field{"frame2", &DiskHullSlipRows::frame2},
                          Field{"solid", &DiskHullSlipRows::solid}, Field{"rim", &DiskHullSlipRows::rim});
    }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const NearestOnDisk<Sides> p(s, solid, rim);
        const TurningTangents<Sides> along(s, p.n, typename Sides::Vec());
        for (int k = 0; k < 2; ++k) out.wrench[k] = force_at(p.place, along.t[k]);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        using Vec = typename Sides::Vec;
        const NearestOnDisk<Sides> p(s, solid, rim);
        if (p.lowest) {
            const TurningTangents<Sides> along(s, p.n, s.b.omega().cross(p.n));
            return slide(s, out, along, p.place, p.lowest->velocity(s, {rim, rim, 0.0}));
        }
        const Sides turned = p.from_hull(s);
        const AlongLineMotion<Sides> m(turned, *p.line);
        const TurningTangents<Sides> along(s, p.n, -m.dn);
        // Velocity of the point on the disk: velocity of the point on the edge, plus the rate of the vector between
        // both points.
        const Vec moves = turned.a.velocity(p.line->place()) + m.slides * p.line->e +
                          p.line->at.n.dot(m.u) * p.n - p.distance * m.dn;
        slide(s, out, along, p.place, moves);
    }
};

}  // namespace pn
