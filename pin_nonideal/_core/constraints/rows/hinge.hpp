// A hinge: the origins of two frames coincide, and so does one axis that is fixed in both frames.
#pragma once

#include <tuple>

#include <cmath>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

// Largest sine of the angle between the axes that equals the angle to rounding.
constexpr double small_sine = 1e-9;

struct HingeRows : ConstraintKind {
    static constexpr const char* name = "hinge";
    static constexpr bool affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::anchor;

    SharedFrame frame1, frame2;
    Vec3 axis, normal1, normal2;  // right-handed, in both frames

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &HingeRows::frame1}, Field{"frame2", &HingeRows::frame2},
                          Field{"axis", &HingeRows::axis}, Field{"normal1", &HingeRows::normal1},
                          Field{"normal2", &HingeRows::normal2});
    }
    int size() const { return 5; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

    // The axis e of frame 1 stays normal to n1 and n2 of frame 2. The angle between the axes scales the residual, so
    // that the residual measures the error of opposed axes too.
    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        using Scalar = typename Sides::Scalar;
        using std::atan2;
        for (int k = 0; k < 3; ++k) out.residual[k] = s.b.R.col(k).dot(s.a.x - s.b.x);  // Eq. (2)
        const auto e = s.a.R * axis, axis2 = s.b.R * axis;
        const Scalar sine = e.cross(axis2).norm(), cosine = e.dot(axis2), angle = atan2(sine, cosine);
        const Scalar stretch = sine > small_sine ? angle / sine : Scalar(1.0);
        const bool opposed = sine <= small_sine && cosine < 0.0;
        out.residual[3] = opposed ? Scalar(M_PI) : stretch * (s.b.R * normal1).dot(e);
        out.residual[4] = opposed ? Scalar(0.0) : stretch * (s.b.R * normal2).dot(e);
    }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        for (int k = 0; k < 3; ++k) out.wrench[k] = force_at(s.a.x, s.b.R.col(k));
        const auto e = s.a.R * axis;
        out.wrench[3] = couple_at(s.a.x, e.cross(s.b.R * normal1));
        out.wrench[4] = couple_at(s.a.x, e.cross(s.b.R * normal2));
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const PointMotion<typename Sides::Pose> point(s);
        for (int k = 0; k < 3; ++k) point.row(out, k, s.b.R.col(k));
        axis_row(s, out, 3, s.b.R * normal1);
        axis_row(s, out, 4, s.b.R * normal2);
    }

private:
    // Set row k to the rate and bias of e . n, for n fixed in body 2.
    template <class Sides, class Out>
    PN_INLINE void axis_row(const Sides& s, Out& out, int k, const typename Sides::Vec& n) const {
        const auto e = s.a.R * axis, w = e.cross(n);
        const auto dw = s.a.omega().cross(e).cross(n) + e.cross(s.b.omega().cross(n));
        out.rate[k] = w.dot(s.a.omega() - s.b.omega());
        out.bias[k] = w.dot(s.a.alpha() - s.b.alpha()) + dw.dot(s.a.omega() - s.b.omega());
    }
};

}  // namespace pn
