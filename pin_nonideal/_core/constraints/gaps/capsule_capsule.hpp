// The gap between two spheres or capsules (segments along their frames' z axes, with a radius).
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/segments.hpp"

namespace pn {

struct CapsuleCapsuleRow {
    static constexpr const char* name = "capsule_capsule";
    static constexpr Role role = Role::contact;
    static constexpr bool constant_A = false, affine_rate = true, comparable_rows = false;
    static constexpr int pressing = 0;
    static constexpr DisplayKind shown = DisplayKind::contact;

    Frame frame1, frame2;
    double half1, half2, radius;  // radius: sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CapsuleCapsuleRow::frame1}, Field{"frame2", &CapsuleCapsuleRow::frame2},
                          Field{"half1", &CapsuleCapsuleRow::half1}, Field{"half2", &CapsuleCapsuleRow::half2},
                          Field{"radius", &CapsuleCapsuleRow::radius});
    }
    int size() const { return 1; }
    bool is_holonomic(int) const { return true; }
    bool moves_in_time() const { return false; }

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
