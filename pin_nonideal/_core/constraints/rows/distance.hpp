// |x1 - x2| = length(t): a rod.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "math/time_function.hpp"

namespace pn {

struct DistanceRows : ConstraintKind {
    static constexpr const char* name = "distance";
    static constexpr bool affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::rod;

    SharedFrame frame1, frame2;
    TimeFunction length;

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &DistanceRows::frame1}, Field{"frame2", &DistanceRows::frame2},
                          Field{"length", &DistanceRows::length});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return !is_constant(length); }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        const Jet l = evaluate(length, s.t);
        out.residual[0] = (s.a.x - s.b.x).norm() - l[0];  // Eq. (2)
        out.phi_t[0] = -l[1];
        out.phi_tt[0] = -l[2];
    }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const auto d = s.a.x - s.b.x;
        out.wrench[0] = force_at(s.a.x, direction(d, d.norm()));
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        using Scalar = typename Sides::Scalar;
        const auto d = s.a.x - s.b.x, u = s.a.velocity(s.a.x) - s.b.velocity(s.b.x);
        const Scalar distance = d.norm();
        const auto n = direction(d, distance);
        const Scalar along = n.dot(u);
        out.rate[0] = along + out.phi_t[0];
        out.bias[0] = n.dot(s.a.acceleration(s.a.x) - s.b.acceleration(s.b.x)) + out.phi_tt[0];
        if (distance > 0.0) out.bias[0] += (u.squaredNorm() - along * along) / distance;
    }

private:
    template <class Vec, class Scalar>
    static PN_INLINE Vec direction(const Vec& d, const Scalar& distance) {
        return distance > 0.0 ? Vec(d / distance) : Vec(Vec3::UnitX());
    }
};

}  // namespace pn
