// The gap between the rim of a wheel, or an ellipsoid, and the plane of frame 2. A rim is an ellipsoid with one semiaxis
// zero, along the axis of the wheel.
#pragma once

#include <algorithm>
#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/lowest_on_rim_or_ellipsoid.hpp"

namespace pn {

struct PlaneRimOrEllipsoidRow : PlaneGap {
    static constexpr const char* name = "plane_ellipsoid";

    SharedFrame frame1, frame2;
    Vec3 normal, semiaxes;

    static constexpr auto data() {
        return std::tuple(Field{"frame", &PlaneRimOrEllipsoidRow::frame1}, Field{"plane", &PlaneRimOrEllipsoidRow::frame2},
                          Field{"normal", &PlaneRimOrEllipsoidRow::normal},
                          Field{"semiaxes", &PlaneRimOrEllipsoidRow::semiaxes});
    }
    double extent1() const { return std::max({semiaxes[0], semiaxes[1], semiaxes[2]}); }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        const LowestOnEllipsoid<Sides> lowest(s, normal, semiaxes);
        out.residual[0] = lowest.n.dot(s.a.x - s.b.x) - lowest.depth;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const LowestOnEllipsoid<Sides> lowest(s, normal, semiaxes);
        out.residual[0] = lowest.n.dot(s.a.x - s.b.x) - lowest.depth;
        out.wrench[0] = force_at(lowest.place, lowest.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const LowestOnEllipsoid<Sides> lowest(s, normal, semiaxes);
        sliding_row(s, out, 0, lowest.n, lowest.place, lowest.velocity(s, semiaxes));
    }
};

}  // namespace pn
