// Directions of friction: sliding of the contact point along the plane of frame 2.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct PlanePointSlipRows : ContactSlip {
    static constexpr const char* name = "plane_point_slip";

    SharedFrame frame1, frame2;
    double radius;
    Vec3 tangent1, tangent2, normal;

    static constexpr auto data() {
        return std::tuple(Field{"frame", &PlanePointSlipRows::frame1}, Field{"plane", &PlanePointSlipRows::frame2},
                          Field{"radius", &PlanePointSlipRows::radius},
                          Field{"tangent1", &PlanePointSlipRows::tangent1},
                          Field{"tangent2", &PlanePointSlipRows::tangent2},
                          Field{"normal", &PlanePointSlipRows::normal});
    }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const auto contact = s.a.x - radius * (s.b.R * normal);
        out.wrench[0] = force_at(contact, s.b.R * tangent1);
        out.wrench[1] = force_at(contact, s.b.R * tangent2);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const auto n = s.b.R * normal, contact = s.a.x - radius * n;
        const auto rate = s.a.velocity(s.a.x) - radius * s.b.omega().cross(n);
        sliding_row(s, out, 0, s.b.R * tangent1, contact, rate);
        sliding_row(s, out, 1, s.b.R * tangent2, contact, rate);
    }
};

}  // namespace pn
