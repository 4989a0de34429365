// The height of a sphere's (or point's) center over the plane of frame 2 equals its radius.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct PlanePointRow : PlaneGap {
    static constexpr const char* name = "plane_point";

    SharedFrame frame1, frame2;
    Vec3 normal;
    double radius;

    static constexpr auto data() {
        return std::tuple(Field{"frame", &PlanePointRow::frame1}, Field{"plane", &PlanePointRow::frame2},
                          Field{"normal", &PlanePointRow::normal}, Field{"radius", &PlanePointRow::radius});
    }
    double extent1() const { return 0.0; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = (s.b.R * normal).dot(s.a.x - s.b.x) - radius;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        out.wrench[0] = force_at(s.a.x, s.b.R * normal);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        PointMotion<typename Sides::Pose>(s).row(out, 0, s.b.R * normal);
    }
};

}  // namespace pn
