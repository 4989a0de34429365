// Directions of friction: sliding of a sphere along a convex solid.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_box.hpp"
#include "constraints/gaps/nearest_on_hull.hpp"
#include "constraints/gaps/nearest_on_revolved.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

template <class Solid>
struct SolidHullSlipRows : ContactSlip {
    static constexpr const char* name = Solid::slip;

    SharedFrame frame1, frame2;
    Solid solid;
    double radius1;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &SolidHullSlipRows::frame1}, Field{"frame2", &SolidHullSlipRows::frame2},
                          Field{"solid", &SolidHullSlipRows::solid}, Field{"radius1", &SolidHullSlipRows::radius1});
    }

    template <class Sides>
    PN_INLINE auto nearest(const Sides& s) const { return typename Solid::template Nearest<Sides>(s, solid); }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const auto p = nearest(s);
        const TurningTangents<Sides> along(s, p.n, typename Sides::Vec());
        const auto contact = s.a.x - radius1 * p.n;
        for (int k = 0; k < 2; ++k) out.wrench[k] = force_at(contact, along.t[k]);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const auto p = nearest(s);
        const auto dn = s.b.omega().cross(p.n) + p.turning(s.a.velocity(s.a.x) - s.b.velocity(s.a.x));
        const TurningTangents<Sides> along(s, p.n, dn);
        const auto contact = s.a.x - radius1 * p.n;
        slide(s, out, along, contact, s.a.velocity(s.a.x) - radius1 * dn);
    }
};

using BoxSlipRows = SolidHullSlipRows<Box>;
using HullSlipRows = SolidHullSlipRows<Hull>;
using RevolvedSlipRows = SolidHullSlipRows<Revolved>;

}  // namespace pn
