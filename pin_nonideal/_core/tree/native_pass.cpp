#include "tree/native_pass.hpp"

#include <algorithm>
#include <cmath>

#include "math/angles.hpp"

namespace pn {

namespace {

// Rotate R0 about its column k. Columns with a compile-time index stay in registers.
template <int k>
PN_INLINE void rotate_about(const Mat3& R0, double c, double s, Mat3& R) {
    constexpr int a = (k + 1) % 3, b = (k + 2) % 3;
    R.col(k) = R0.col(k);
    R.col(a) = c * R0.col(a) + s * R0.col(b);
    R.col(b) = c * R0.col(b) - s * R0.col(a);
}

// Rotate R0 about the joint's axis by the angle with this cosine and sine.
PN_INLINE void rotate(const Joint& j, const Mat3& R0, double c, double s, Mat3& R) {
    switch (j.axis_index) {
        case 0: return rotate_about<0>(R0, c, j.axis_sign * s, R);
        case 1: return rotate_about<1>(R0, c, j.axis_sign * s, R);
        case 2: return rotate_about<2>(R0, c, j.axis_sign * s, R);
        default: break;
    }
    const Vec3& e = j.axis;
    const Mat3 turned({c, s * e[2], -s * e[1]}, {-s * e[2], c, s * e[0]}, {s * e[1], -s * e[0], c});
    R = R0 * Mat3(turned.c[0] + ((1.0 - c) * e[0]) * e, turned.c[1] + ((1.0 - c) * e[1]) * e,
                  turned.c[2] + ((1.0 - c) * e[2]) * e);
}

PN_INLINE Vec3 axis_in_world(const Joint& j, const Mat3& R) {
    if (j.axis_index >= 0) return j.axis_sign * R.col(j.axis_index);
    return R * j.axis;
}

// Columns of J for a dof that rotates about an axis through the body's origin, or slides along the axis.
PN_INLINE Motion turning(const Body& b, const Vec3& axis) { return {b.p.cross(axis), axis}; }
PN_INLINE Motion sliding(const Vec3& axis) { return {axis, Vec3::Zero()}; }

PN_INLINE Motion relative_velocity(const Joint& j, const std::vector<Motion>& J, const VecX& v) {
    Motion r = v[j.iv] * J[j.iv];
    for (int k = 1; k < j.nv; ++k) r += v[j.iv + k] * J[j.iv + k];
    return r;
}

// Compute the placement of the joint's moving frame into R, p and ref of body b.
PN_INLINE void place(const Joint& j, const Body& parent, const VecX& q, const CosSin& angle, Body& b,
                     const JointMotion& other) {
    const bool is_root = j.parent == 0;
    Mat3 R0;
    Vec3 p0;
    if (is_root) {
        R0 = j.R0;
        p0 = j.p0;
    } else {
        R0 = j.aligned ? parent.R : parent.R * j.R0;
        p0 = parent.p + parent.R * j.p0;
    }
    const double* x = q.data() + j.iq;
    switch (j.kind) {
        case JointKind::revolute:
        case JointKind::helical: {
            rotate(j, R0, j.unbounded ? x[0] : angle.c, j.unbounded ? x[1] : angle.s, b.R);
            b.p = p0;
            if (j.kind == JointKind::helical) {
                const double turns = j.unbounded ? std::atan2(x[1], x[0]) : x[0];
                b.p += (j.pitch * turns) * axis_in_world(j, R0);
            }
            break;
        }
        case JointKind::prismatic:
            b.R = R0;
            b.p = p0 + x[0] * axis_in_world(j, R0);
            break;
        case JointKind::spherical:
            b.R = R0 * Mat3(Eigen::Quaterniond(x[3], x[0], x[1], x[2]).toRotationMatrix());
            b.p = p0;
            break;
        case JointKind::free_flyer:
            b.R = R0 * Mat3(Eigen::Quaterniond(x[6], x[3], x[4], x[5]).toRotationMatrix());
            b.p = p0 + R0 * Vec3(x[0], x[1], x[2]);
            break;
        case JointKind::planar:
            b.R = R0 * Mat3({x[2], x[3], 0.0}, {-x[3], x[2], 0.0}, {0.0, 0.0, 1.0});
            b.p = p0 + R0 * Vec3(x[0], x[1], 0.0);
            break;
        case JointKind::translation:
            b.R = R0;
            b.p = p0 + R0 * Vec3(x[0], x[1], x[2]);
            break;
        case JointKind::other:
            b.R = R0 * other.R;
            b.p = p0 + R0 * other.p;
            break;
    }
    if (is_root) {  // the reference point of this tree is here
        b.ref = b.p;
        b.p = Vec3::Zero();
    } else {
        b.ref = parent.ref;
    }
}

// Move the reference point of joint i's tree to joint i. The bodies before joint i only slide, so their motions do not
// depend on the reference point.
void recenter(const Mechanism& m, int i, BodyTerms& terms) {
    const Vec3 moved = terms.body[i].p;
    for (int k = m.joints[i].root; k <= i; ++k)
        if (m.joints[k].root == m.joints[i].root) {
            terms.body[k].p -= moved;
            terms.body[k].ref += moved;
        }
}

// Compute columns J of the joint's dofs in world axes.
PN_INLINE void columns(const Joint& j, const Body& b, const JointMotion& other, Motion* J) {
    switch (j.kind) {
        case JointKind::revolute: J[0] = turning(b, axis_in_world(j, b.R)); break;
        case JointKind::helical: {
            const Vec3 axis = axis_in_world(j, b.R);
            J[0] = turning(b, axis);
            J[0].lin += j.pitch * axis;
            break;
        }
        case JointKind::prismatic: J[0] = sliding(axis_in_world(j, b.R)); break;
        case JointKind::spherical:
            for (int k = 0; k < 3; ++k) J[k] = turning(b, b.R.col(k));
            break;
        case JointKind::free_flyer:
            for (int k = 0; k < 3; ++k) {
                J[k] = sliding(b.R.col(k));
                J[k + 3] = turning(b, b.R.col(k));
            }
            break;
        case JointKind::planar:
            J[0] = sliding(b.R.col(0));
            J[1] = sliding(b.R.col(1));
            J[2] = turning(b, b.R.col(2));
            break;
        case JointKind::translation:
            for (int k = 0; k < 3; ++k) J[k] = sliding(b.R.col(k));
            break;
        case JointKind::other:
            for (int k = 0; k < j.nv; ++k) J[k] = in_world(b, other.S[k]);
            break;
    }
}

}  // namespace

NativePass::NativePass(const Mechanism& m) : cos_sin(m.joints.size()), others(m), rest(VecX::Zero(m.nv)) {
    int max_dofs = 0;
    for (const Joint& j : m.joints)
        if (j.kind == JointKind::other) max_dofs = std::max(max_dofs, j.nv);
    motion.S.resize(max_dofs);
}

// The functions below are compiled twice, for mechanisms with deep trees and without. The second version has no checks
// for deep trees.

// Place body i relative to its parent. In a deep tree, `shift` becomes the vector from the parent's reference point to
// its own.
template <bool some_deep>
static PN_INLINE void place_body(const Mechanism& m, NativePass& pass, BodyTerms& terms, int i, Vec3& shift) {
    const Joint& j = m.joints[i];
    if (j.kind == JointKind::other) pass.others.evaluate(m, i, terms.q, pass.rest, pass.motion);
    Body& b = terms.body[i];
    place(j, terms.body[j.parent], terms.q, pass.cos_sin[i], b, pass.motion);
    if (j.recenters) recenter(m, i, terms);
    if (!some_deep || !j.deep) return;
    shift = b.p;
    b.ref += b.p;
    b.p = Vec3::Zero();
}

// Compute the inertia of a placed body.
static PN_INLINE void weigh_body(const Joint& j, Body& b) { b.Y = b.inertia = in_world(b, j.mass, j.com, j.inertia); }

// Compute cosines and sines of angles, four at a time. The last group is padded with the last angle.
static PN_INLINE void find_cos_sin(NativePass& pass, const BodyTerms& terms, const std::vector<Angle>& angles) {
    const int n = static_cast<int>(angles.size());
    for (int k = 0; k < n; k += 4) {
        Lanes x, c, s;
        for (int i = 0; i < 4; ++i) x[i] = terms.q[angles[std::min(k + i, n - 1)].iq];
        cosines_and_sines(x, c, s);
        for (int i = 0; i < 4; ++i) pass.cos_sin[angles[std::min(k + i, n - 1)].joint] = {c[i], s[i]};
    }
}

PN_WIDE void place_bodies(const Mechanism& m, NativePass& pass, BodyTerms& terms, const std::vector<int>& joints,
                          const std::vector<Angle>& angles) {
    find_cos_sin(pass, terms, angles);
    Vec3 shift;  // local, so that the shifts of the factor remain
    for (int i : joints) place_body<true>(m, pass, terms, i, shift);
}

template <bool some_deep>
static PN_INLINE void place_all(const Mechanism& m, NativePass& pass, BodyTerms& terms) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = 1; i < n; ++i) {
        place_body<some_deep>(m, pass, terms, i, terms.deep.shift[i]);
        const Joint& j = m.joints[i];
        columns(j, terms.body[i], pass.motion, terms.J.data() + j.iv);
        weigh_body(j, terms.body[i]);
        if (!j.recenters) continue;
        for (int k = j.root; k < i; ++k)  // inertias about their new reference
            if (m.joints[k].root == j.root) weigh_body(m.joints[k], terms.body[k]);
    }
}

PN_WIDE void place_bodies(const Mechanism& m, NativePass& pass, BodyTerms& terms) {
    find_cos_sin(pass, terms, m.angles);
    if (m.deep_joints.empty()) place_all<false>(m, pass, terms);
    else place_all<true>(m, pass, terms);
}

template <bool some_deep>
static PN_INLINE void move_all(const Mechanism& m, NativePass& pass, BodyTerms& terms, const VecX& v) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = 1; i < n; ++i) {
        const Joint& j = m.joints[i];
        Body& b = terms.body[i];
        const Body& parent = terms.body[j.parent];
        b.v = parent.v;
        b.a = parent.a;
        if (some_deep && j.deep) {
            b.v = further(parent.v, terms.deep.shift[i]);
            b.a = further(parent.a, terms.deep.shift[i]);
        }
        const Motion r = relative_velocity(j, terms.J, v);
        b.v += r;
        b.a += cross(b.v, r);
        if (j.kind == JointKind::other) {
            pass.others.evaluate(m, i, terms.q, v, pass.motion);
            b.a += in_world(b, pass.motion.bias);
        }
    }
}

PN_WIDE void move_bodies(const Mechanism& m, NativePass& pass, BodyTerms& terms, const VecX& v) {
    if (m.deep_joints.empty()) move_all<false>(m, pass, terms, v);
    else move_all<true>(m, pass, terms, v);
}

template <bool some_deep>
static PN_INLINE void fill_M(const Mechanism& m, BodyTerms& terms) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = n - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        if (some_deep && j.deep) continue;
        const Body& b = terms.body[i];
        for (int dof = j.iv + j.nv - 1; dof >= j.iv; --dof) {
            terms.Ag[dof] = b.Y * terms.J[dof];
            double* row = terms.M.data() + m.row_offset[dof];
            const int* up = m.ancestors.data() + m.row_offset[dof];
            for (int s = 0; s <= m.depth[dof]; ++s) row[s] = dot(terms.J[up[s]], terms.Ag[dof]);  // M of Eq. (1)
            row[0] += m.armature[dof];
        }
        if (j.parent != 0) terms.body[j.parent].Y += b.Y;
    }
}

PN_WIDE void mass_matrix(const Mechanism& m, NativePass&, BodyTerms& terms) {
    if (m.deep_joints.empty()) fill_M<false>(m, terms);
    else fill_M<true>(m, terms);
}

template <bool some_deep>
static PN_INLINE void sum_bias_forces(const Mechanism& m, BodyTerms& terms) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = 1; i < n; ++i) {
        Body& b = terms.body[i];
        b.f = bias_force(b);
        if (some_deep && m.joints[i].deep) terms.deep.bias[i] = b.f;
    }
    for (int i = n - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        const Body& b = terms.body[i];
        for (int dof = j.iv; dof < j.iv + j.nv; ++dof) terms.nle[dof] = dot(terms.J[dof], b.f);  // in F of Eq. (1)
        if (j.parent == 0) continue;
        if (some_deep && j.deep) terms.body[j.parent].f += before(b.f, terms.deep.shift[i]);
        else terms.body[j.parent].f += b.f;
    }
}

PN_WIDE void bias_forces(const Mechanism& m, NativePass&, BodyTerms& terms) {
    if (m.deep_joints.empty()) sum_bias_forces<false>(m, terms);
    else sum_bias_forces<true>(m, terms);
}

}  // namespace pn
