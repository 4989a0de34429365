// The gap between a disk, the rim of a cylinder or cone, and a convex hull with a radius.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_disk.hpp"

namespace pn {

struct DiskHullRow {
    static constexpr const char* name = "disk_hull";
    static constexpr Role role = Role::contact;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr int pressing = 0;
    static constexpr DisplayKind shown = DisplayKind::contact;

    Frame frame1, frame2;
    Hull solid;
    double rim, radius;  // radius of the disk, and radius around the hull

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &DiskHullRow::frame1}, Field{"frame2", &DiskHullRow::frame2},
                          Field{"solid", &DiskHullRow::solid}, Field{"rim", &DiskHullRow::rim},
                          Field{"radius", &DiskHullRow::radius});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

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
