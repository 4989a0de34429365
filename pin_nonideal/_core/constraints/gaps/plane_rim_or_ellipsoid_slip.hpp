// Directions of friction: sliding of the lowest point of a rim or ellipsoid along the plane of frame 2.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/lowest_on_rim_or_ellipsoid.hpp"

namespace pn {

struct PlaneRimOrEllipsoidSlipRows : ContactSlip {
    static constexpr const char* name = "plane_ellipsoid_slip";

    SharedFrame frame1, frame2;
    Vec3 semiaxes, tangent1, tangent2, normal;

    static constexpr auto data() {
        return std::tuple(Field{"frame", &PlaneRimOrEllipsoidSlipRows::frame1},
                          Field{"plane", &PlaneRimOrEllipsoidSlipRows::frame2},
                          Field{"semiaxes", &PlaneRimOrEllipsoidSlipRows::semiaxes},
                          Field{"tangent1", &PlaneRimOrEllipsoidSlipRows::tangent1},
                          Field{"tangent2", &PlaneRimOrEllipsoidSlipRows::tangent2},
                          Field{"normal", &PlaneRimOrEllipsoidSlipRows::normal});
    }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const LowestOnEllipsoid<Sides> lowest(s, normal, semiaxes);
        out.wrench[0] = force_at(lowest.place, s.b.R * tangent1);
        out.wrench[1] = force_at(lowest.place, s.b.R * tangent2);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const LowestOnEllipsoid<Sides> lowest(s, normal, semiaxes);
        const auto rate = lowest.velocity(s, semiaxes);
        sliding_row(s, out, 0, s.b.R * tangent1, lowest.place, rate);
        sliding_row(s, out, 1, s.b.R * tangent2, lowest.place, rate);
    }
};

}  // namespace pn
