// Directions of friction: sliding of a capsule or a rounded edge along a cylinder or cone.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_along_line.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct CapsuleCylinderSlipRows : ContactSlip {
    static constexpr const char* name = "capsule_cylinder_slip";

    SharedFrame frame1, frame2;
    Revolved solid;
    double half1, radius1;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CapsuleCylinderSlipRows::frame1},
                          Field{"frame2", &CapsuleCylinderSlipRows::frame2},
                          Field{"solid", &CapsuleCylinderSlipRows::solid},
                          Field{"half1", &CapsuleCylinderSlipRows::half1},
                          Field{"radius1", &CapsuleCylinderSlipRows::radius1});
    }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const NearestAlongLine<Sides> p(s, solid, half1);
        const TurningTangents<Sides> along(s, p.at.n, typename Sides::Vec());
        const auto contact = p.place() - radius1 * p.at.n;
        for (int k = 0; k < 2; ++k) out.wrench[k] = force_at(contact, along.t[k]);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestAlongLine<Sides> p(s, solid, half1);
        const AlongLineMotion<Sides> m(s, p);
        const TurningTangents<Sides> along(s, p.at.n, m.dn);
        const auto c = p.place();
        slide(s, out, along, c - radius1 * p.at.n, s.a.velocity(c) + m.slides * p.e - radius1 * m.dn);
    }
};

}  // namespace pn
