// The gap between two spheres or capsules (segments along their frames' z axes, with a radius).
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct CapsuleCapsuleRow : ShapeGap {
    static constexpr const char* name = "capsule_capsule";

    SharedFrame frame1, frame2;
    double half1, half2, radius;  // radius: sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CapsuleCapsuleRow::frame1}, Field{"frame2", &CapsuleCapsuleRow::frame2},
                          Field{"half1", &CapsuleCapsuleRow::half1}, Field{"half2", &CapsuleCapsuleRow::half2},
                          Field{"radius", &CapsuleCapsuleRow::radius});
    }
    double extent1() const { return half1; }
    double extent2() const { return half2; }
    double support1(const Vec3& direction) const { return half1 * std::abs(direction[2]); }
    double support2(const Vec3& direction) const { return half2 * std::abs(direction[2]); }
    double max_depth() const { return radius; }
    double depth_to_next_face(const Vec3&) const { return HUGE_VAL; }
    template <class Sides>
    auto normal(const Sides& s) const { return NearestPoints<Sides>(s, half1, half2).n; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = NearestPoints<Sides>(s, half1, half2).distance - radius;  // Eq. (2)
    }
    // The force acts at the first nearest point. The second lies on its line of action.
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const NearestPoints<Sides> p(s, half1, half2);
        out.residual[0] = p.distance - radius;
        out.wrench[0] = force_at(p.c1, p.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestPoints<Sides> p(s, half1, half2);
        const NearestMotion<Sides> m(s, p);
        out.rate[0] = p.n.dot(m.u);
        const auto du = s.a.acceleration(p.c1) + s.a.omega().cross(m.along1) - s.b.acceleration(p.c2) -
                        s.b.omega().cross(m.along2);
        out.bias[0] = p.n.dot(du) + m.dn.dot(m.u);
    }
};

}  // namespace pn
