// The gap between a capsule or a rounded edge (a segment with a radius) and a cylinder or cone.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_along_line.hpp"

namespace pn {

struct CapsuleCylinderRow {
    static constexpr const char* name = "capsule_cylinder";
    static constexpr Role role = Role::contact;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr int pressing = 0;
    static constexpr DisplayKind shown = DisplayKind::contact;

    Frame frame1, frame2;
    Revolved solid;
    double half1, radius;  // half length of the segment, and sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CapsuleCylinderRow::frame1}, Field{"frame2", &CapsuleCylinderRow::frame2},
                          Field{"solid", &CapsuleCylinderRow::solid}, Field{"half1", &CapsuleCylinderRow::half1},
                          Field{"radius", &CapsuleCylinderRow::radius});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = NearestAlongLine<Sides>(s, solid, half1).at.distance - radius;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const NearestAlongLine<Sides> p(s, solid, half1);
        out.residual[0] = p.at.distance - radius;
        out.wrench[0] = force_at(p.place(), p.at.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestAlongLine<Sides> p(s, solid, half1);
        const AlongLineMotion<Sides> m(s, p);
        out.rate[0] = p.at.n.dot(m.u);
        out.bias[0] = m.bias;
    }
};

}  // namespace pn
