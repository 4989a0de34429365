// Directions of friction: rotation of body 1 against body 2 about axes of frame 2 (all three for a ball joint, some for
// a contact).
#pragma once

#include <tuple>
#include <vector>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct SpinSlipRows : SlipDirections {
    static constexpr const char* name = "spin_slip";

    SharedFrame frame1, frame2;
    std::vector<int> axes;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &SpinSlipRows::frame1}, Field{"frame2", &SpinSlipRows::frame2},
                          Field{"axes", &SpinSlipRows::axes});
    }
    int size() const { return static_cast<int>(axes.size()); }

    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        for (size_t k = 0; k < axes.size(); ++k) out.wrench[k] = couple_at(s.a.x, s.b.R.col(axes[k]));
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const auto omega = s.a.omega() - s.b.omega(), alpha = s.a.alpha() - s.b.alpha() - s.b.omega().cross(omega);
        for (size_t k = 0; k < axes.size(); ++k) {
            out.rate[k] = s.b.R.col(axes[k]).dot(omega);
            out.bias[k] = s.b.R.col(axes[k]).dot(alpha);
        }
    }
};

}  // namespace pn
