// The height of a sphere's (or point's) center over the plane of frame 2 equals its radius.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct PlanePointRow {
    static constexpr const char* name = "plane_point";
    static constexpr Role role = Role::contact;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr DisplayKind shown = DisplayKind::contact;
    static constexpr int pressing = 0;

    Frame frame1, frame2;
    Vec3 normal;
    double radius;

    static constexpr auto data() {
        return std::tuple(Field{"frame", &PlanePointRow::frame1}, Field{"plane", &PlanePointRow::frame2},
                          Field{"normal", &PlanePointRow::normal}, Field{"radius", &PlanePointRow::radius});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

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
