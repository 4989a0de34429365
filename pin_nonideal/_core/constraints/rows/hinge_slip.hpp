// Direction of friction: rotation about the common axis of a hinge anchor.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct HingeSlipRows : SlipDirections {
    static constexpr const char* name = "hinge_slip";

    SharedFrame frame1, frame2;
    Vec3 axis;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &HingeSlipRows::frame1}, Field{"frame2", &HingeSlipRows::frame2},
                          Field{"axis", &HingeSlipRows::axis});
    }
    int size() const { return 1; }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        out.wrench[0] = couple_at(s.a.x, s.a.R * axis);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const auto e = s.a.R * axis, omega = s.a.omega() - s.b.omega();
        out.rate[0] = e.dot(omega);
        out.bias[0] = e.dot(s.a.alpha() - s.b.alpha()) + s.a.omega().cross(e).dot(omega);
    }
};

}  // namespace pn
