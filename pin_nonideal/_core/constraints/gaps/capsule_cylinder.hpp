// The gap between a capsule or a rounded edge (a segment with a radius) and a cylinder or cone.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_along_line.hpp"

namespace pn {

struct CapsuleCylinderRow : ShapeGap {
    static constexpr const char* name = "capsule_cylinder";

    SharedFrame frame1, frame2;
    Revolved solid;
    double half1, radius;  // half length of the segment, and sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &CapsuleCylinderRow::frame1}, Field{"frame2", &CapsuleCylinderRow::frame2},
                          Field{"solid", &CapsuleCylinderRow::solid}, Field{"half1", &CapsuleCylinderRow::half1},
                          Field{"radius", &CapsuleCylinderRow::radius});
    }
    double extent1() const { return half1; }
    double extent2() const { return solid.reach; }
    double support1(const Vec3& direction) const { return half1 * std::abs(direction[2]); }
    double support2(const Vec3& direction) const { return solid.support(direction); }
    double max_depth() const { return radius; }
    double depth_to_next_face(const Vec3&) const { return HUGE_VAL; }
    template <class Sides>
    auto normal(const Sides& s) const { return NearestAlongLine<Sides>(s, solid, half1).at.n; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = NearestAlongLine<Sides>(s, solid, half1).at.distance - radius;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const NearestAlongLine<Sides> p(s, solid, half1);
        out.residual[0] = p.at.distance - radius;
        out.wrench[0] = force_at(p.place(), p.at.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const NearestAlongLine<Sides> p(s, solid, half1);
        const AlongLineMotion<Sides> m(s, p);
        out.rate[0] = p.at.n.dot(m.u);
        out.bias[0] = m.bias;
    }
};

}  // namespace pn
