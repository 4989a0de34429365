// The gap between a disk, the rim of a cylinder or cone, and a convex hull with a radius.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_disk.hpp"

namespace pn {

struct DiskHullRow : ShapeGap {
    static constexpr const char* name = "disk_hull";

    SharedFrame frame1, frame2;
    Hull solid;
    double rim, radius;  // radius of the disk, and radius around the hull

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &DiskHullRow::frame1}, Field{"frame2", &DiskHullRow::frame2},
                          Field{"solid", &DiskHullRow::solid}, Field{"rim", &DiskHullRow::rim},
                          Field{"radius", &DiskHullRow::radius});
    }
    double extent1() const { return rim; }
    double extent2() const { return solid.reach; }
    double support1(const Vec3& direction) const { return rim * std::hypot(direction[0], direction[1]); }
    double support2(const Vec3& direction) const { return solid.support(direction); }
    double max_depth() const { return radius; }
    // Over a face, the rim may enter the hull up to half of its width. An edge may not pass the disk.
    template <class Sides>
    double max_depth(const Sides& s) const {
        return radius + (NearestOnDisk<Sides>(s, solid, rim).lowest ? solid.half_width() : 0.0);
    }
    double depth_to_next_face(const Vec3&) const { return HUGE_VAL; }
    template <class Sides>
    auto normal(const Sides& s) const { return NearestOnDisk<Sides>(s, solid, rim).n; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = NearestOnDisk<Sides>(s, solid, rim).distance - radius;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const NearestOnDisk<Sides> p(s, solid, rim);
        out.residual[0] = p.distance - radius;
        out.wrench[0] = force_at(p.place, p.n);
    }
    // Over a face, the rates equal the rates of a disk over a plane. Beside an edge, these rates equal the rates of the edge
    // over the disk.
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestOnDisk<Sides> p(s, solid, rim);
        if (p.lowest) {
            sliding_row(s, out, 0, p.n, p.place, p.lowest->velocity(s, {rim, rim, 0.0}));
            return;
        }
        const AlongLineMotion<Sides> m(p.from_hull(s), *p.line);
        out.rate[0] = p.line->at.n.dot(m.u);
        out.bias[0] = m.bias;
    }
};

}  // namespace pn
