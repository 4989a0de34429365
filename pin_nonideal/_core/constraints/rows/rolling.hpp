// A disk or a sphere rolls on the plane of frame 2 without slip and without lifting.
#pragma once

#include <tuple>

#include "constraints/geometry.hpp"
#include "constraints/row_traits.hpp"

namespace pn {

struct RollingRows : ConstraintKind {
    static constexpr const char* name = "rolling";
    static constexpr bool affine_rate = true;
    static constexpr DisplayKind shown = DisplayKind::rolling;
    static constexpr int pressing = 2;

    SharedFrame frame1, frame2;
    double radius;
    bool sphere;
    Vec3 axis;  // unit vector along the axis of the disk, in frame 1; unused for a sphere
    Vec3 tangent1, tangent2, normal;  // in frame 2

    static constexpr auto data() {
        return std::tuple(Field{"frame", &RollingRows::frame1}, Field{"plane", &RollingRows::frame2},
                          Field{"radius", &RollingRows::radius}, Field{"sphere", &RollingRows::sphere},
                          Field{"axis", &RollingRows::axis}, Field{"tangent1", &RollingRows::tangent1},
                          Field{"tangent2", &RollingRows::tangent2}, Field{"normal", &RollingRows::normal});
    }
    int size() const { return 3; }
    bool is_holonomic(int row) const { return row == 2; }
    bool moves_in_time() const { return false; }

    template <class Sides, class Out>
    PN_INLINE void residual(const Sides& s, Out& out) const {
        out.residual[2] = (s.b.R * normal).dot(s.a.x - s.b.x) - radius * Contact<Sides>(*this, s).support;  // Eq. (2)
    }
    template <class Sides, class Out>
    PN_INLINE void rows(const Sides& s, Out& out) const {
        const Contact<Sides> contact(*this, s);
        out.wrench[0] = force_at(contact.point, s.b.R * tangent1);
        out.wrench[1] = force_at(contact.point, s.b.R * tangent2);
        out.wrench[2] = force_at(contact.point, s.b.R * normal);
    }
    template <class Sides, class Out>
    PN_INLINE void rate_and_bias(const Sides& s, Out& out) const {
        const Contact<Sides> contact(*this, s);
        sliding_row(s, out, 0, s.b.R * tangent1, contact.point, contact.rate);
        sliding_row(s, out, 1, s.b.R * tangent2, contact.point, contact.rate);
        sliding_row(s, out, 2, s.b.R * normal, contact.point, contact.rate);
    }

private:
    template <class Sides>
    struct Contact {  // contact point and its rate
        using Vec = typename Sides::Vec;
        Vec point, rate;
        typename Sides::Scalar support = 1.0;  // height of the center divided by the radius

        PN_INLINE Contact(const RollingRows& c, const Sides& s) {
            const Vec n = s.b.R * c.normal, dn = s.b.omega().cross(n);
            Vec down = -n, ddown = -dn;  // unit vector from the center to the contact, and its rate
            if (!c.sphere) {
                const Vec e = s.a.R * c.axis, de = s.a.omega().cross(e);
                const auto ne = n.dot(e);
                const Vec w = n - ne * e, dw = dn - (dn.dot(e) + n.dot(de)) * e - ne * de;
                support = w.norm();
                down = -w / support;
                ddown = -(dw - w * (w.dot(dw) / (support * support))) / support;
            }
            point = s.a.x + c.radius * down;
            rate = s.a.velocity(s.a.x) + c.radius * ddown;
        }
    };
};

}  // namespace pn
