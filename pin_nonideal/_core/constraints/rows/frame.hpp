// A weld: the origins and all three axes of two frames coincide.
#pragma once

#include <tuple>

#include <cmath>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

// Sine of half an angle below which a series gives the angle. The next term of its factor, 3/20 n^4, is 2e-17.
constexpr double small_turn = 1e-4;

// Return the rotation vector of R.
template <class Vec, class Mat>
Vec logarithm(const Mat& R) {
    using std::atan2;
    const auto turned = R.eigen();
    using Scalar = typename std::decay_t<decltype(turned)>::Scalar;
    const Eigen::Quaternion<Scalar> q(turned);
    const Scalar n = q.vec().norm();
    if (n < small_turn && q.w() > 0.0) return (2.0 + n * n / 3.0) * q.vec();
    const Scalar angle = 2.0 * atan2(n, q.w());
    const Scalar wrapped = angle > M_PI ? angle - 2.0 * M_PI : angle;
    return (wrapped / n) * q.vec();
}

struct FrameRows : ConstraintKind {
    static constexpr const char* name = "frame";
    static constexpr bool affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::anchor;

    SharedFrame frame1, frame2;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &FrameRows::frame1}, Field{"frame2", &FrameRows::frame2});
    }
    int size() const { return 6; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        const auto rotation = logarithm<typename Sides::Vec>(transpose_times(s.b.R, s.a.R));
        for (int k = 0; k < 3; ++k) {
            out.residual[k] = s.b.R.col(k).dot(s.a.x - s.b.x);  // Eq. (2)
            out.residual[k + 3] = rotation[k];
        }
    }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        for (int k = 0; k < 3; ++k) {
            out.wrench[k] = force_at(s.a.x, s.b.R.col(k));
            out.wrench[k + 3] = couple_at(s.a.x, s.b.R.col(k));
        }
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const PointMotion<typename Sides::Pose> point(s);
        const auto omega = s.a.omega() - s.b.omega(), alpha = s.a.alpha() - s.b.alpha() - s.b.omega().cross(omega);
        for (int k = 0; k < 3; ++k) {
            point.row(out, k, s.b.R.col(k));
            out.rate[k + 3] = s.b.R.col(k).dot(omega);
            out.bias[k + 3] = s.b.R.col(k).dot(alpha);
        }
    }
};

}  // namespace pn
