// Directions of friction: sliding of a sphere or capsule along another one, at their contact point.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct CapsuleCapsuleSlipRows : ContactSlip {
    static constexpr const char* name = "capsule_capsule_slip";

    SharedFrame frame1, frame2;
    double half1, half2, radius1;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CapsuleCapsuleSlipRows::frame1},
                          Field{"frame2", &CapsuleCapsuleSlipRows::frame2},
                          Field{"half1", &CapsuleCapsuleSlipRows::half1},
                          Field{"half2", &CapsuleCapsuleSlipRows::half2},
                          Field{"radius1", &CapsuleCapsuleSlipRows::radius1});
    }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const NearestPoints<Sides> p(s, half1, half2);
        const TurningTangents<Sides> along(s, p.n, typename Sides::Vec());
        const auto contact = p.c1 - radius1 * p.n;
        for (int k = 0; k < 2; ++k) out.wrench[k] = force_at(contact, along.t[k]);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestPoints<Sides> p(s, half1, half2);
        const NearestMotion<Sides> m(s, p);
        const TurningTangents<Sides> along(s, p.n, m.dn);
        const auto contact = p.c1 - radius1 * p.n;
        slide(s, out, along, contact, s.a.velocity(p.c1) + m.along1 - radius1 * m.dn);
    }
};

}  // namespace pn
