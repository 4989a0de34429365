// e . (x1 - x2) = 0 for axes e of frame 2: a ball joint, or part of it.
#pragma once

#include <tuple>
#include <vector>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct PointRows : ConstraintKind {
    static constexpr const char* name = "point";
    static constexpr bool affine_rate = true, comparable_rows = true;
    static constexpr DisplayKind shown = DisplayKind::anchor;

    SharedFrame frame1, frame2;
    std::vector<int> axes;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &PointRows::frame1}, Field{"frame2", &PointRows::frame2},
                          Field{"axes", &PointRows::axes});
    }
    int size() const { return static_cast<int>(axes.size()); }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        for (size_t k = 0; k < axes.size(); ++k) out.residual[k] = s.b.R.col(axes[k]).dot(s.a.x - s.b.x);  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        for (size_t k = 0; k < axes.size(); ++k) out.wrench[k] = force_at(s.a.x, s.b.R.col(axes[k]));
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const PointMotion<typename Sides::Pose> point(s);
        for (size_t k = 0; k < axes.size(); ++k) point.row(out, static_cast<int>(k), s.b.R.col(axes[k]));
    }
};

}  // namespace pn
