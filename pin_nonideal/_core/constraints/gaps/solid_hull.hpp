// The gap between a sphere and a convex solid, both with a radius.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"
#include "constraints/gaps/nearest_on_box.hpp"
#include "constraints/gaps/nearest_on_hull.hpp"
#include "constraints/gaps/nearest_on_revolved.hpp"

namespace pn {

// Solid: a shape in the axes of frame 2 that computes its nearest point, its reach and its supporting planes.
template <class Solid>
struct SolidHullRow : ShapeGap {
    static constexpr const char* name = Solid::gap;

    SharedFrame frame1, frame2;
    Solid solid;
    double radius;  // sum of both radii

    static constexpr auto data() {
        return std::tuple(Field{"frame1", &SolidHullRow::frame1}, Field{"frame2", &SolidHullRow::frame2},
                          Field{"solid", &SolidHullRow::solid}, Field{"radius", &SolidHullRow::radius});
    }
    double extent1() const { return 0.0; }
    double extent2() const { return solid.reach; }
    double support1(const Vec3&) const { return 0.0; }
    double support2(const Vec3& direction) const { return solid.support(direction); }
    // A point inside the solid is nearest to another face beyond the middle between two faces.
    double max_depth() const { return radius + solid.half_width(); }
    double depth_to_next_face(const Vec3& at) const {
        const auto [nearest, next] = solid.nearest_planes(at);
        return radius + (next > 0.0 ? next - std::max(nearest, 0.0) : 0.0);
    }
    template <class Sides>
    auto normal(const Sides& s) const { return nearest(s).n; }

    template <class Sides>
    PN_INLINE auto nearest(const Sides& s) const { return typename Solid::template Nearest<Sides>(s, solid); }
    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[0] = nearest(s).distance - radius;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void place(const Sides& s, Out& out) const {
        const auto p = nearest(s);
        out.residual[0] = p.distance - radius;
        out.wrench[0] = force_at(s.a.x, p.n);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const auto p = nearest(s);
        const PointMotion<typename Sides::Pose> motion(s);
        out.rate[0] = p.n.dot(motion.u);
        out.bias[0] = p.n.dot(motion.du) + p.turning(motion.u).dot(motion.u);
    }
};

using BoxRow = SolidHullRow<Box>;
using HullRow = SolidHullRow<Hull>;
using RevolvedRow = SolidHullRow<Revolved>;

}  // namespace pn
