// The gap between two cylinders, cones or disks, each with a radius around it.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_of_cylinders.hpp"

namespace pn {

struct CylinderCylinderRow : ShapeGap {
    static constexpr const char* name = "cylinder_cylinder";
    static constexpr DisplayKind shown = DisplayKind::nothing;

    SharedFrame frame1, frame2;
    Revolved first, second;
    double radius;  // sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CylinderCylinderRow::frame1}, Field{"frame2", &CylinderCylinderRow::frame2},
                          Field{"first", &CylinderCylinderRow::first}, Field{"second", &CylinderCylinderRow::second},
                          Field{"radius", &CylinderCylinderRow::radius});
    }
    double extent1() const { return first.reach; }
    double extent2() const { return second.reach; }
    double support1(const Vec3& direction) const { return first.support(direction); }
    double support2(const Vec3& direction) const { return second.support(direction); }
    double max_depth() const { return radius; }
    double depth_to_next_face(const Vec3&) const { return HUGE_VAL; }
    template <class Sides>
    auto normal(const Sides& s) const { return NearestOfCylinders<Sides>(s, first, second).n; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = NearestOfCylinders<Sides>(s, first, second).distance - radius;  // Eq. (2)
    }
    // The force acts at the nearest point that slides. The other one lies on its line of action.
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const NearestOfCylinders<Sides> p(s, first, second);
        out.residual[0] = p.distance - radius;
        out.wrench[0] = force_at(p.found.place, p.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestOfCylinders<Sides> p(s, first, second);
        const CylindersMotion<Sides> m(p.mover(s), p.found);
        out.rate[0] = p.found.at.n.dot(m.u);
        out.bias[0] = m.bias;
    }
};

}  // namespace pn
