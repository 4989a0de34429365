// Directions of friction: sliding of a sphere along a box.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_box.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct PointBoxSlipRows : SlipDirections {
    static constexpr const char* name = "point_box_slip";

    Frame frame1, frame2;
    Vec3 half;
    double radius1;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &PointBoxSlipRows::frame1}, Field{"frame2", &PointBoxSlipRows::frame2},
                          Field{"half", &PointBoxSlipRows::half}, Field{"radius1", &PointBoxSlipRows::radius1});
    }
    int size() const { return 2; }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const NearestOnBox<Sides> p(s, half);
        const TurningTangents<Sides> along(s, p.n, typename Sides::Vec());
        const auto contact = s.a.x - radius1 * p.n;
        for (int k = 0; k < 2; ++k) out.wrench[k] = force_at(contact, along.t[k]);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestOnBox<Sides> p(s, half);
        const auto dn = s.b.omega().cross(p.n) + p.turning(s.a.velocity(s.a.x) - s.b.velocity(s.a.x));
        const TurningTangents<Sides> along(s, p.n, dn);
        const auto contact = s.a.x - radius1 * p.n;
        slide(s, out, along, contact, s.a.velocity(s.a.x) - radius1 * dn);
    }
};

}  // namespace pn
