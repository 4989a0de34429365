#include "constraints/constraints.hpp"

#include <algorithm>
#include <cmath>

#include "math/unrolled.hpp"
#include "tree/liegroup.hpp"

namespace pn {

namespace {

struct Pose {  // a frame in the world
    const Body& body;
    Mat3 R;
    Vec3 x;
    const Mechanism& m;

    PN_INLINE Pose(const State& s, const Frame& f)
        : body(s.terms.body[f.joint]), R(f.R), x(f.p), m(s.mechanism) {
        if (f.joint == 0) return;  // fixed to the world
        R = body.R * f.R;
        x = body.ref + body.p + body.R * f.p;
    }
    PN_INLINE const Vec3& omega() const { return body.v.ang; }
    PN_INLINE const Vec3& alpha() const { return body.a.ang; }
    PN_INLINE Vec3 velocity(const Vec3& at) const { return velocity_at(body, at); }
    PN_INLINE Vec3 acceleration(const Vec3& at) const { return acceleration_at(m, body, at); }
};

Vec3 logarithm(const Mat3& R) {  // rotation vector
    const Eigen::Quaterniond q(R.eigen());
    const double n = q.vec().norm();
    if (n < 1e-4 && q.w() > 0.0) return (2.0 + n * n / 3.0) * q.vec();
    const double angle = 2.0 * std::atan2(n, q.w());
    const double wrapped = angle > M_PI ? angle - 2.0 * M_PI : angle;
    return (wrapped / n) * q.vec();
}

double wrap(double x, double period) { return period > 0.0 ? std::remainder(x, period) : x; }

double joint_angle(const Joint& j, const VecX& q) {
    return j.unbounded ? std::atan2(q[j.iq + 1], q[j.iq]) : q[j.iq];
}

// Formulas of all kinds, those of the parts before bodies move, or those of the motion.
template <Part part>
struct Evaluate {
    static constexpr bool moving = part == Part::motion;
    const State& s;
    RowValues& out;

    // Velocity and acceleration of frame 1's origin, seen from body 2.
    struct PointMotion {
        Vec3 u, w;

        PN_INLINE PointMotion(const Pose& a, const Pose& b) {
            if constexpr (!moving) return;
            u = a.velocity(a.x) - b.velocity(a.x);
            w = a.acceleration(a.x) - b.acceleration(a.x) - 2.0 * b.omega().cross(u);
        }
    };

    // Row k: that velocity along e, which is fixed in body 2.
    PN_INLINE void point_row(const Pose& a, const Pose& b, const PointMotion& point, const Vec3& e, double offset,
                             int k) const {
        if constexpr (moving) {
            out.rate[k] = e.dot(point.u);
            out.drift[k] = e.dot(point.w);
        } else {
            out.wrench[k] = {e, a.x, Vec3::Zero()};
            out.residual[k] = e.dot(a.x - b.x) - offset;
        }
    }

    // Sliding of body 1 against the plane of body 2 at a contact point c that moves with rate c_rate.
    PN_INLINE void contact_row(const Pose& a, const Pose& b, const Vec3& e, const Vec3& c, const Vec3& c_rate, int k) const {
        if constexpr (moving) {
            const Vec3 va = a.velocity(c), vb = b.velocity(c), u = va - vb;
            const Vec3 du = a.acceleration(c) + a.omega().cross(c_rate - va) - b.acceleration(c) -
                            b.omega().cross(c_rate - vb) - b.omega().cross(u);
            out.rate[k] = e.dot(u);
            out.drift[k] = e.dot(du);
        } else {
            out.wrench[k] = {e, c, Vec3::Zero()};
            out.residual[k] = 0.0;
        }
    }

    PN_INLINE void operator()(const PointRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const PointMotion point(a, b);
        for (size_t k = 0; k < c.axes.size(); ++k) point_row(a, b, point, b.R.col(c.axes[k]), 0.0, k);
    }

    PN_INLINE void operator()(const ContactRow& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        point_row(a, b, {a, b}, b.R * c.normal, c.radius, 0);
    }

    PN_INLINE void operator()(const FrameRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const PointMotion point(a, b);
        for (int k = 0; k < 3; ++k) point_row(a, b, point, b.R.col(k), 0.0, k);
        if constexpr (moving) {
            const Vec3 omega = a.omega() - b.omega(), alpha = a.alpha() - b.alpha() - b.omega().cross(omega);
            for (int k = 0; k < 3; ++k) {
                out.rate[k + 3] = b.R.col(k).dot(omega);
                out.drift[k + 3] = b.R.col(k).dot(alpha);
            }
        } else {
            const Vec3 gap = logarithm(transpose_times(b.R, a.R));
            for (int k = 0; k < 3; ++k) {
                out.wrench[k + 3] = {Vec3::Zero(), a.x, b.R.col(k)};
                out.residual[k + 3] = gap[k];
            }
        }
    }

    PN_INLINE void operator()(const HingeRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const PointMotion point(a, b);
        for (int k = 0; k < 3; ++k) point_row(a, b, point, b.R.col(k), 0.0, k);
        // The axis e of frame 1 stays normal to n1 and n2 of frame 2; the angle between the axes scales the residual,
        // so that it tells the gap also when they point apart.
        const Vec3 e = a.R * c.axis;
        const Vec3 normals[2] = {b.R * c.normal1, b.R * c.normal2};
        for (int k = 0; k < 2; ++k) {
            const Vec3& n = normals[k];
            const Vec3 w = e.cross(n);
            if constexpr (moving) {
                const Vec3 dw = a.omega().cross(e).cross(n) + e.cross(b.omega().cross(n));
                out.rate[k + 3] = w.dot(a.omega() - b.omega());
                out.drift[k + 3] = w.dot(a.alpha() - b.alpha()) + dw.dot(a.omega() - b.omega());
            } else {
                const Vec3 axis2 = b.R * c.axis;
                const double sine = e.cross(axis2).norm(), cosine = e.dot(axis2), angle = std::atan2(sine, cosine);
                const double stretch = sine > 1e-9 ? angle / sine : 1.0;
                out.wrench[k + 3] = {Vec3::Zero(), a.x, w};
                out.residual[k + 3] = stretch * n.dot(e);
                if (sine <= 1e-9 && cosine < 0.0) out.residual[k + 3] = k == 0 ? M_PI : 0.0;
            }
        }
    }

    PN_INLINE void operator()(const DistanceRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const Vec3 d = a.x - b.x;
        const double distance = d.norm();
        const Vec3 n = distance > 0.0 ? Vec3(d / distance) : Vec3::UnitX();
        if constexpr (moving) {
            const Vec3 u = a.velocity(a.x) - b.velocity(b.x);
            const double along = n.dot(u);
            out.rate[0] = along + out.phi_t[0];
            out.drift[0] = n.dot(a.acceleration(a.x) - b.acceleration(b.x)) + out.phi_tt[0];
            if (distance > 0.0) out.drift[0] += (u.squaredNorm() - along * along) / distance;
        } else {
            const Jet length = evaluate(c.length, s.t);
            out.wrench[0] = {n, a.x, Vec3::Zero()};
            out.residual[0] = distance - length[0];
            out.phi_t[0] = -length[1];
            out.phi_tt[0] = -length[2];
        }
    }

    PN_INLINE void operator()(const KnifeRows& c) const {
        const Pose a(s, c.frame1);
        const Vec3 e = a.R * c.axis;
        if constexpr (moving) {
            const Vec3 u = a.velocity(a.x);
            out.rate[0] = e.dot(u);
            out.drift[0] = e.dot(a.acceleration(a.x)) + a.omega().cross(e).dot(u);
        } else {
            out.wrench[0] = {e, a.x, Vec3::Zero()};
        }
    }

    PN_INLINE void operator()(const RollingRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const Vec3 n = b.R * c.normal, dn = b.omega().cross(n);
        Vec3 down = -n, ddown = -dn;  // unit vector from the center to the contact, and its rate
        double support = 1.0;
        if (!c.sphere) {
            const Vec3 e = a.R * c.axle, de = a.omega().cross(e);
            const double ne = n.dot(e);
            const Vec3 w = n - ne * e, dw = dn - (dn.dot(e) + n.dot(de)) * e - ne * de;
            support = w.norm();
            down = -w / support;
            ddown = -(dw - w * (w.dot(dw) / (support * support))) / support;
        }
        const Vec3 contact = a.x + c.radius * down, rate = a.velocity(a.x) + c.radius * ddown;
        contact_row(a, b, b.R * c.tangent1, contact, rate, 0);
        contact_row(a, b, b.R * c.tangent2, contact, rate, 1);
        contact_row(a, b, n, contact, rate, 2);
        if constexpr (!moving) out.residual[2] = n.dot(a.x - b.x) - c.radius * support;
    }

    PN_INLINE void operator()(const HingeSlipRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const Vec3 e = a.R * c.axis;
        if constexpr (moving) {
            const Vec3 omega = a.omega() - b.omega();
            out.rate[0] = e.dot(omega);
            out.drift[0] = e.dot(a.alpha() - b.alpha()) + a.omega().cross(e).dot(omega);
        } else {
            out.wrench[0] = {Vec3::Zero(), a.x, e};
        }
    }

    PN_INLINE void operator()(const ContactSlipRows& c) const {
        const Pose a(s, c.frame1), b(s, c.frame2);
        const Vec3 n = b.R * c.normal, contact = a.x - c.radius * n;
        const Vec3 rate = a.velocity(a.x) - c.radius * b.omega().cross(n);
        contact_row(a, b, b.R * c.tangent1, contact, rate, 0);
        contact_row(a, b, b.R * c.tangent2, contact, rate, 1);
    }

    PN_INLINE void operator()(const CouplingRows& c) const {
        const Joint &j1 = s.mechanism.joints[c.joint1], &j2 = s.mechanism.joints[c.joint2];
        if constexpr (moving) {
            out.rate[0] = s.v[j1.iv] - c.ratio * s.v[j2.iv];
            return;
        }
        if (!out.has_A) {
            out.A(0, j1.iv) = 1.0;
            out.A(0, j2.iv) = -c.ratio;
        }
        const double gap = joint_angle(j1, s.q) - c.ratio * joint_angle(j2, s.q) - c.offset;
        out.residual[0] = c.position ? wrap(gap, c.period) : 0.0;
    }

    PN_INLINE void operator()(const MotionRows& c) const {
        const Joint& j = s.mechanism.joints[c.joint];
        if constexpr (moving) {
            out.rate[0] = s.v[j.iv] + out.phi_t[0];
            out.drift[0] = out.phi_tt[0];
            return;
        }
        const Jet f = evaluate(c.function, s.t);
        if (!out.has_A) out.A(0, j.iv) = 1.0;
        out.residual[0] = wrap(joint_angle(j, s.q) - f[0], c.period);
        out.phi_t[0] = -f[1];
        out.phi_tt[0] = -f[2];
    }

    // The user's A and b come together, with the place part.
    PN_INLINE void operator()(const UserRows& c) const {
        if (moving && c.rate) {
            c.rate(s.t, s.q, s.v, out.scratch);
            for (int k = 0; k < out.rows; ++k) out.rate[k] = out.scratch[k];
        }
        if (!moving && c.residual) {
            c.residual(s.t, s.q, out.scratch);
            for (int k = 0; k < out.rows; ++k) out.residual[k] = out.scratch[k];
        }
        if (part != Part::place) return;
        c.rows(s.t, s.q, s.v, out.A, out.b);
        for (int k = 0; k < out.rows; ++k) out.drift[k] = -out.b[k];
    }

    PN_INLINE void operator()(const DofRows& c) const {
        for (int k = 0; k < c.count; ++k) {
            if (moving) out.rate[k] = s.v[c.dof + k];
            else if (!out.has_A) out.A(k, c.dof + k) = 1.0;
        }
    }

    PN_INLINE void operator()(const UserSlipRow& c) const {
        if constexpr (!moving) {
            c.direction(s.t, s.q, out.scratch);
            out.A.row(0) = out.scratch.transpose();
            return;
        }
        out.rate[0] = out.A.row(0).dot(s.v);
        // The direction's own rate, by a difference along the motion: d(n(t, q))/dt . v.
        const double h = 1e-6;
        VecX ahead(s.q.size()), row(s.v.size());
        const VecX step = h * s.v, back = -step;
        retract(s.mechanism, s.q.data(), step.data(), ahead.data());
        c.direction(s.t + h, ahead, row);
        const double forward = row.dot(s.v);
        retract(s.mechanism, s.q.data(), back.data(), ahead.data());
        c.direction(s.t - h, ahead, row);
        out.drift[0] = (forward - row.dot(s.v)) / (2.0 * h);
    }
};

}  // namespace

void RowValues::resize(int n, int nv, bool is_geometric) {
    rows = n;
    geometric = is_geometric;
    wrench.assign(is_geometric ? n : 0, Wrench{Vec3::Zero(), Vec3::Zero(), Vec3::Zero()});
    drift.assign(n, 0.0);
    residual.assign(n, 0.0);
    rate.assign(n, 0.0);
    phi_t.assign(n, 0.0);
    phi_tt.assign(n, 0.0);
    if (is_geometric) return;
    A = MatX::Zero(n, nv);
    b = VecX::Zero(n);
    scratch = VecX::Zero(std::max(n, nv));
}

// Like std::visit, but part of the caller.
template <class Formula, size_t... kind_index>
static PN_INLINE void apply(const Formula& formula, const Kind& kind, std::index_sequence<kind_index...>) {
    (void)((kind.index() == kind_index && (formula(*std::get_if<kind_index>(&kind)), true)) || ...);
}

template <Part part>
static PN_INLINE void evaluate_part(const Kind& kind, const State& s, RowValues& out) {
    apply(Evaluate<part>{s, out}, kind, std::make_index_sequence<std::variant_size_v<Kind>>());
}

PN_WIDE void evaluate(const Kind& kind, const State& s, Part part, RowValues& out) {
    switch (part) {
        case Part::gap: evaluate_part<Part::gap>(kind, s, out); break;
        case Part::place: evaluate_part<Part::place>(kind, s, out); break;
        case Part::motion: evaluate_part<Part::motion>(kind, s, out); break;
    }
}

PN_WIDE void fill_A(const Block& block, const Terms& terms, const RowValues& values, double* A) {
    const int r = static_cast<int>(block.kept.size()), n = static_cast<int>(block.support.size());
    if (!values.geometric) {
        for (int l = 0; l < n; ++l)
            for (int k = 0; k < r; ++k) A[l * r + k] = values.A(block.kept[k], block.support[l]);
        return;
    }
    std::fill(A, A + static_cast<size_t>(r) * n, 0.0);
    for (int k = 0; k < r; ++k) {
        const Wrench& w = values.wrench[block.kept[k]];
        // About the reference points of the two bodies (they differ when the bodies belong to different trees).
        const Force f1{w.force, w.couple + (w.point - terms.body[block.joint1].ref).cross(w.force)};
        const Force f2{w.force, w.couple + (w.point - terms.body[block.joint2].ref).cross(w.force)};
        for (const Block::Entry& e : block.entries)
            A[e.place * r + k] = e.sign > 0.0 ? dot(terms.J[e.dof], f1) : -dot(terms.J[e.dof], f2);
    }
}

void scale_rows(const Mechanism& m, const Terms& terms, const Block& block, const double* A, double* B) {
    const int n = static_cast<int>(block.support.size());
    std::copy(A, A + block.kept.size() * n, B);
    with_rows(static_cast<int>(block.kept.size()), [&](auto r) {
        for (int l = 0; l < n; ++l) {
            const int dof = block.support[l];
            const double* row = terms.L.data() + m.row_offset[dof];
            double* __restrict x = B + l * r;
            for (int p = block.parent[l], s = 1; p >= 0; p = block.parent[p], ++s) {
                double* __restrict y = B + p * r;  // of an ancestor
                for (int k = 0; k < r; ++k) y[k] -= row[s] * x[k];
            }
            const double d = terms.inv_sqrt_D[dof];
            for (int k = 0; k < r; ++k) x[k] *= d;
        }
    });
}

}  // namespace pn
