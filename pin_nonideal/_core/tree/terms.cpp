#include "tree/terms.hpp"

#include <algorithm>
#include <cmath>

#include "math/angles.hpp"

namespace pn {

namespace {

// R0 turned about the joint's axis by the angle with this cosine and sine, touching only the columns that change.
PN_INLINE void turn(const Joint& j, const Mat3& R0, double c, double s, Mat3& R) {
    if (j.axis_index < 0) {
        const Vec3& e = j.axis;
        const Mat3 turned({c, s * e[2], -s * e[1]}, {-s * e[2], c, s * e[0]}, {s * e[1], -s * e[0], c});
        R = R0 * Mat3(turned.c[0] + ((1.0 - c) * e[0]) * e, turned.c[1] + ((1.0 - c) * e[1]) * e,
                      turned.c[2] + ((1.0 - c) * e[2]) * e);
        return;
    }
    const int k = j.axis_index, a = (k + 1) % 3, b = (k + 2) % 3;
    s *= j.axis_sign;
    R.col(k) = R0.col(k);
    R.col(a) = c * R0.col(a) + s * R0.col(b);
    R.col(b) = c * R0.col(b) - s * R0.col(a);
}

PN_INLINE Vec3 axis_in_world(const Joint& j, const Mat3& R) {
    if (j.axis_index >= 0) return j.axis_sign * R.col(j.axis_index);
    return R * j.axis;
}

// Columns for a dof that turns about direction w through the body's origin, or slides along it.
PN_INLINE Motion turning(const Body& b, const Vec3& w) { return {b.p.cross(w), w}; }
PN_INLINE Motion sliding(const Vec3& w) { return {w, Vec3::Zero()}; }

PN_INLINE Motion relative_velocity(const Joint& j, const std::vector<Motion>& J, const VecX& v) {
    Motion r = v[j.iv] * J[j.iv];
    for (int k = 1; k < j.nv; ++k) r += v[j.iv + k] * J[j.iv + k];
    return r;
}

// Placement of the joint's moving frame; fills R, p and the reference of body b.
PN_INLINE void place(const Joint& j, const Body& parent, const VecX& q, const Turn& turned, Body& b,
                     const JointMotion& foreign) {
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
            turn(j, R0, j.unbounded ? x[0] : turned.c, j.unbounded ? x[1] : turned.s, b.R);
            b.p = p0;
            if (j.kind == JointKind::helical) {
                const double angle = j.unbounded ? std::atan2(x[1], x[0]) : x[0];
                b.p += (j.pitch * angle) * axis_in_world(j, R0);
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
            b.R = R0 * foreign.R;
            b.p = p0 + R0 * foreign.p;
            break;
    }
    if (is_root) {  // the reference point of this tree is here
        b.ref = b.p;
        b.p = Vec3::Zero();
    } else {
        b.ref = parent.ref;
    }
}

// Moves the reference point of joint i's tree to its place. The bodies before it only slide, so that their motions do
// not depend on the reference point.
void recenter(const Mechanism& m, int i, Terms& w) {
    const Vec3 shift = w.body[i].p;
    for (int k = m.joints[i].root; k <= i; ++k)
        if (m.joints[k].root == m.joints[i].root) {
            w.body[k].p -= shift;
            w.body[k].ref += shift;
        }
}

// Columns J of the joint's dofs in world axes.
PN_INLINE void columns(const Joint& j, const Body& b, const JointMotion& foreign, Motion* J) {
    switch (j.kind) {
        case JointKind::revolute: J[0] = turning(b, axis_in_world(j, b.R)); break;
        case JointKind::helical: {
            const Vec3 w = axis_in_world(j, b.R);
            J[0] = turning(b, w);
            J[0].lin += j.pitch * w;
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
            for (int k = 0; k < j.nv; ++k) {
                J[k] = turning(b, b.R * Vec3(foreign.S.col(k).tail<3>()));
                J[k].lin += b.R * Vec3(foreign.S.col(k).head<3>());
            }
            break;
    }
}

}  // namespace

void Terms::allocate(const Mechanism& m) {
    body.assign(m.joints.size(), Body{});
    turn.assign(m.joints.size(), Turn{});
    body[0].a = {-m.gravity, Vec3::Zero()};
    J.assign(m.nv, Motion{Vec3::Zero(), Vec3::Zero()});
    Ag.assign(m.nv, Force{Vec3::Zero(), Vec3::Zero()});
    nle = VecX::Zero(m.nv);
    L.assign(m.row_entries, 0.0);
    M.assign(m.row_entries, 0.0);
    D = VecX::Zero(m.nv);
    inv_sqrt_D = VecX::Zero(m.nv);
    locked.assign(m.nv, 0);
    q = VecX::Zero(m.nq);
    rest = VecX::Zero(m.nv);
    foreign = m.make_foreign();
}

// Places body i behind its parent.
static PN_INLINE void place_body(const Mechanism& m, Terms& w, int i) {
    const Joint& j = m.joints[i];
    if (j.kind == JointKind::other) w.foreign->evaluate(i, w.q, w.rest, w.foreign_motion);
    place(j, w.body[j.parent], w.q, w.turn[i], w.body[i], w.foreign_motion);
    if (j.recenters) recenter(m, i, w);
}

// Inertia of a body in its place.
static PN_INLINE void weigh_body(const Joint& j, Body& b) {
    const Vec3 c = b.p + b.R * j.com;
    Inertia& Y = b.own;
    Y.mass = j.mass;
    Y.first = j.mass * c;
    Y.second = times_transpose(b.R * j.inertia, b.R);
    const double square = c.dot(Y.first);
    Y.second.c[0] += square * Vec3::UnitX() - c[0] * Y.first;
    Y.second.c[1] += square * Vec3::UnitY() - c[1] * Y.first;
    Y.second.c[2] += square * Vec3::UnitZ() - c[2] * Y.first;
    b.Y = Y;
}

// Cosines and sines of angles, by fours; the last group is filled up with the last angle.
static PN_INLINE void turn_joints(Terms& w, const std::vector<Angle>& angles) {
    const int n = static_cast<int>(angles.size());
    for (int k = 0; k < n; k += 4) {
        Lanes x, c, s;
        for (int i = 0; i < 4; ++i) x[i] = w.q[angles[std::min(k + i, n - 1)].iq];
        cosines_and_sines(x, c, s);
        for (int i = 0; i < 4; ++i) w.turn[angles[std::min(k + i, n - 1)].joint] = {c[i], s[i]};
    }
}

PN_WIDE void place_bodies(const Mechanism& m, Terms& w, const VecX& q, const std::vector<int>& joints,
                          const std::vector<Angle>& angles) {
    w.q = q;
    normalize(m, w.q.data());
    turn_joints(w, angles);
    for (int i : joints) place_body(m, w, i);
}

PN_WIDE void place_bodies(const Mechanism& m, Terms& w, const VecX& q) {
    w.q = q;
    normalize(m, w.q.data());
    turn_joints(w, m.angles);
    const int n = static_cast<int>(m.joints.size());
    for (int i = 1; i < n; ++i) {
        place_body(m, w, i);
        const Joint& j = m.joints[i];
        if (j.nv > 0) columns(j, w.body[i], w.foreign_motion, w.J.data() + j.iv);
        weigh_body(j, w.body[i]);
        if (!j.recenters) continue;
        for (int k = j.root; k < i; ++k)  // about their new reference
            if (m.joints[k].root == j.root) weigh_body(m.joints[k], w.body[k]);
    }
}

PN_WIDE void move_bodies(const Mechanism& m, Terms& w, const VecX& v) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = 1; i < n; ++i) {
        const Joint& j = m.joints[i];
        Body& b = w.body[i];
        const Body& parent = w.body[j.parent];
        b.v = parent.v;
        b.a = parent.a;
        if (j.nv == 0) continue;
        const Motion r = relative_velocity(j, w.J, v);
        b.v += r;
        b.a += cross(b.v, r);
        if (j.kind == JointKind::other) {
            w.foreign->evaluate(i, w.q, v, w.foreign_motion);
            const Motion& c = w.foreign_motion.bias;
            Motion bias = turning(b, b.R * c.ang);
            bias.lin += b.R * c.lin;
            b.a += bias;
        }
    }
}

PN_WIDE void mass_matrix(const Mechanism& m, Terms& w) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = n - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        const Body& b = w.body[i];
        for (int dof = j.iv + j.nv - 1; dof >= j.iv; --dof) {
            w.Ag[dof] = b.Y * w.J[dof];
            double* row = w.M.data() + m.row_offset[dof];
            const int* up = m.ancestors.data() + m.row_offset[dof];
            for (int s = 0; s <= m.depth[dof]; ++s) row[s] = dot(w.J[up[s]], w.Ag[dof]);
            row[0] += m.armature[dof];
        }
        if (j.parent != 0) w.body[j.parent].Y += b.Y;
    }
}

PN_WIDE void bias_forces(const Mechanism& m, Terms& w) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = 1; i < n; ++i) {
        Body& b = w.body[i];
        b.f = b.own * b.a;
        b.f += cross(b.v, b.own * b.v);
    }
    for (int i = n - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        const Body& b = w.body[i];
        for (int dof = j.iv; dof < j.iv + j.nv; ++dof) w.nle[dof] = dot(w.J[dof], b.f);
        if (j.parent != 0) w.body[j.parent].f += b.f;
    }
}

void kinematics(const Mechanism& m, Terms& w, const VecX& q, const VecX& v) {
    place_bodies(m, w, q);
    move_bodies(m, w, v);
}

void inertia(const Mechanism& m, Terms& w) {
    mass_matrix(m, w);
    bias_forces(m, w);
}

int factorize(const Mechanism& m, Terms& w) {
    // From the leaves to the root: row k eliminates itself from the rows of its ancestors.
    w.L = w.M;
    for (int k = m.nv - 1; k >= 0; --k) {
        const int depth = m.depth[k];
        const int* up = m.ancestors.data() + m.row_offset[k];
        double* __restrict row = w.L.data() + m.row_offset[k];
        if (w.locked[k]) {
            std::fill(row + 1, row + depth + 1, 0.0);
            w.D[k] = 1.0;
            w.inv_sqrt_D[k] = 0.0;
            continue;
        }
        for (int s = 1; s <= depth; ++s)
            if (w.locked[up[s]]) row[s] = 0.0;
        const double pivot = row[0];
        if (!(pivot > 0.0)) return k;
        w.D[k] = pivot;
        w.inv_sqrt_D[k] = 1.0 / std::sqrt(pivot);
        const double inverse = 1.0 / pivot;
        int s = 1;
        for (; s < depth; s += 2) {  // two ancestors at a time, whose rows are never the row itself
            const double f = row[s] * inverse, g = row[s + 1] * inverse;
            double* __restrict one = w.L.data() + m.row_offset[up[s]];
            double* __restrict two = w.L.data() + m.row_offset[up[s + 1]];
            one[0] -= f * row[s];
            for (int t = s + 1; t <= depth; ++t) {
                one[t - s] -= f * row[t];
                two[t - s - 1] -= g * row[t];
            }
            row[s] = f;  // entries behind are no longer read as M
            row[s + 1] = g;
        }
        if (s == depth) {
            const double f = row[s] * inverse;
            w.L[m.row_offset[up[s]]] -= f * row[s];
            row[s] = f;
        }
    }
    return -1;
}

void solve_R(const Mechanism& m, const Terms& w, VecX& x) {
    for (int k = m.nv - 1; k >= 0; --k) {
        const double xk = x[k];
        if (xk == 0.0) continue;
        const double* row = w.L.data() + m.row_offset[k];
        const int* up = m.ancestors.data() + m.row_offset[k];
        for (int s = 1; s <= m.depth[k]; ++s) x[up[s]] -= row[s] * xk;
        x[k] = xk * w.inv_sqrt_D[k];
    }
}

// Row k of R^-T x, once those of its ancestors are there.
static inline void solve_Rt_row(const Mechanism& m, const Terms& w, int k, VecX& x) {
    const double* row = w.L.data() + m.row_offset[k];
    const int* up = m.ancestors.data() + m.row_offset[k];
    double even = x[k] * w.inv_sqrt_D[k], odd = 0.0;
    int s = 1;
    for (; s < m.depth[k]; s += 2) {
        even -= row[s] * x[up[s]];
        odd -= row[s + 1] * x[up[s + 1]];
    }
    if (s == m.depth[k]) even -= row[s] * x[up[s]];
    x[k] = even + odd;
}

void solve_Rt(const Mechanism& m, const Terms& w, VecX& x) {
    for (int k = 0; k < m.nv; ++k) solve_Rt_row(m, w, k, x);
}

void solve_Rt(const Mechanism& m, const Terms& w, const std::vector<int>& dofs, VecX& x) {
    for (int k : dofs) solve_Rt_row(m, w, k, x);
}

void multiply_M(const Mechanism& m, const Terms& w, const VecX& x, VecX& y) {
    y.setZero();
    for (int k = 0; k < m.nv; ++k) {
        const double* row = w.M.data() + m.row_offset[k];
        const int* up = m.ancestors.data() + m.row_offset[k];
        y[k] += row[0] * x[k];
        for (int s = 1; s <= m.depth[k]; ++s) {
            y[k] += row[s] * x[up[s]];
            y[up[s]] += row[s] * x[k];
        }
    }
}

double kinetic_energy(const Mechanism& m, Terms& w, const VecX& v) {
    double twice = 0.0;
    for (int k = 0; k < m.nv; ++k) {
        const double* row = w.M.data() + m.row_offset[k];
        double sum = 0.5 * row[0] * v[k];
        for (int i = m.dof_parent[k], s = 1; i >= 0; i = m.dof_parent[i], ++s) sum += row[s] * v[i];
        twice += 2.0 * sum * v[k];
    }
    return 0.5 * twice;
}

double potential_energy(const Mechanism& m, const Terms& w) {
    double energy = 0.0;
    for (size_t i = 1; i < m.joints.size(); ++i) {
        const Body& b = w.body[i];
        const Vec3 com = b.ref + b.p + b.R * m.joints[i].com;
        energy -= m.joints[i].mass * m.gravity.dot(com);
    }
    return energy;
}

}  // namespace pn
