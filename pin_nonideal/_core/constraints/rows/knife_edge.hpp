// The origin of a frame has no velocity along an axis of the frame: a skate.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct KnifeEdgeRows : ConstraintKind {
    static constexpr const char* name = "knife_edge";
    static constexpr bool affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::edge;

    SharedFrame frame1, frame2;  // frame2 is the world's
    Vec3 axis;

    static constexpr auto data() {
        return std::tuple(Field{"frame", &KnifeEdgeRows::frame1}, Field{"axis", &KnifeEdgeRows::axis});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return false; }
    bool moves_in_time() const { return false; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides&, Out&) const {}
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        out.wrench[0] = force_at(s.a.x, s.a.R * axis);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const auto e = s.a.R * axis, u = s.a.velocity(s.a.x);
        out.rate[0] = e.dot(u);  // Eq. (2)
        out.bias[0] = e.dot(s.a.acceleration(s.a.x)) + s.a.omega().cross(e).dot(u);
    }
};

}  // namespace pn
