// Directions of friction: sliding of a cylinder, cone or disk along another one.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_of_cylinders.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct CylinderCylinderSlipRows : ContactSlip {
    static constexpr const char* name = "cylinder_cylinder_slip";

    SharedFrame frame1, frame2;
    Revolved first, second;
    double radius1, radius2;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CylinderCylinderSlipRows::frame1},
                          Field{"frame2", &CylinderCylinderSlipRows::frame2},
                          Field{"first", &CylinderCylinderSlipRows::first},
                          Field{"second", &CylinderCylinderSlipRows::second},
                          Field{"radius1", &CylinderCylinderSlipRows::radius1},
                          Field{"radius2", &CylinderCylinderSlipRows::radius2});
    }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const NearestOfCylinders<Sides> p(s, first, second);
        const TurningTangents<Sides> along(s, p.n, typename Sides::Vec());
        for (int k = 0; k < 2; ++k) out.wrench[k] = force_at(contact(p), along.t[k]);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestOfCylinders<Sides> p(s, first, second);
        const Sides mover = p.mover(s);
        const CylindersMotion<Sides> m(mover, p.found);
        const TurningTangents<Sides> along(s, p.n, p.turned ? typename Sides::Vec(-m.dn) : m.dn);
        slide(s, out, along, contact(p), mover.a.velocity(p.found.place) + m.slides - around(p) * m.dn);
    }

private:
    // Return the radius around the body on which the nearest point slides.
    template <class Nearest>
    PN_INLINE double around(const Nearest& p) const { return p.turned ? radius2 : radius1; }
    template <class Sides>
    PN_INLINE typename Sides::Vec contact(const NearestOfCylinders<Sides>& p) const {
        return p.found.place - around(p) * p.found.at.n;
    }
};

}  // namespace pn
