// The gap between a sphere and a rounded box: a box along the axes of frame 2 with a radius around it.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_box.hpp"

namespace pn {

struct PointBoxRow {
    static constexpr const char* name = "point_box";
    static constexpr Role role = Role::contact;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr int pressing = 0;
    static constexpr DisplayKind shown = DisplayKind::contact;

    Frame frame1, frame2;
    Vec3 half;
    double radius;  // sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &PointBoxRow::frame1}, Field{"frame2", &PointBoxRow::frame2},
                          Field{"half", &PointBoxRow::half}, Field{"radius", &PointBoxRow::radius});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = NearestOnBox<Sides>(s, half).distance - radius;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const NearestOnBox<Sides> p(s, half);
        out.residual[0] = p.distance - radius;
        out.wrench[0] = force_at(s.a.x, p.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestOnBox<Sides> p(s, half);
        const PointMotion<typename Sides::Pose> motion(s);
        out.rate[0] = p.n.dot(motion.u);
        out.bias[0] = p.n.dot(motion.du) + p.turning(motion.u).dot(motion.u);
    }
};

}  // namespace pn
