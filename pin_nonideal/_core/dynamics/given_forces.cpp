#include "dynamics/given_forces.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

double joint_position(const Joint& j, const VecX& q) {
    return j.unbounded ? std::atan2(q[j.iq + 1], q[j.iq]) : q[j.iq];
}

struct Apply {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;

    // Apply a force at a world point of a body, and a couple.
    void push(int joint, const Vec3& point, const Vec3& force, const Vec3& couple) const {
        if (joint == 0) return;
        w.now.body_force[joint] += Force{force, couple + (point - w.now.terms.body[joint].ref).cross(force)};
    }
    Vec3 position(const Frame& f) const {
        const Body& b = w.now.terms.body[f.joint];
        return b.ref + b.p + b.R * f.p;
    }

    void operator()(const SpringDamper& s) const {
        const Vec3 x1 = position(s.frame1), x2 = position(s.frame2), d = x1 - x2;
        const Vec3 u = velocity_at(w.now.terms.body[s.frame1.joint], x1) - velocity_at(w.now.terms.body[s.frame2.joint], x2);
        const double length = d.norm();
        Vec3 force = -s.stiffness * d;
        if (length > 0.0) {
            const Vec3 e = d / length;
            force = -(s.stiffness * (length - s.rest_length) + s.damping * e.dot(u)) * e;
        }
        push(s.frame1.joint, x1, force, Vec3::Zero());
        push(s.frame2.joint, x2, -force, Vec3::Zero());
    }
    void operator()(const JointSpring& s) const {
        const Joint& j = p.mechanism.joints[s.joint];
        w.now.external[j.iv] -= s.stiffness * (joint_position(j, q) - s.rest) + s.damping * v[j.iv];
    }
    void operator()(const FrameWrench& f) const {
        double six[6];
        std::copy(f.value, f.value + 6, six);
        if (f.function) f.function(t, six);
        push(f.frame.joint, position(f.frame), Vec3(six[0], six[1], six[2]), Vec3(six[3], six[4], six[5]));
    }
    void operator()(const UserForce& f) const {
        f.function(t, q, v, w.scratch.work);
        w.now.external += w.scratch.work;
    }
};

// Add the torques of a table at a time.
void add_torques(const TorqueTable& table, double t, VecX& tau) {
    const auto& x = table.times;
    if (t <= x.front()) { tau += table.values.col(0); return; }
    if (t >= x.back()) { tau += table.values.col(table.values.cols() - 1); return; }
    const int k = static_cast<int>(std::upper_bound(x.begin(), x.end(), t) - x.begin()) - 1;
    const double s = (t - x[k]) / (x[k + 1] - x[k]);
    tau += (1.0 - s) * table.values.col(k) + s * table.values.col(k + 1);
}

struct Torque {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    VecX& tau;

    void operator()(const NoActuation&) const { tau.setZero(); }
    void operator()(const ConstantTorque& c) const { tau = c.tau; }
    void operator()(const TorqueFunction& f) const { f.function(t, q, v, tau); }
    void operator()(const SampledTorque& s) const {
        if (w.state.has_held) tau = w.state.held_torque;
        else s.function(t, q, v, tau);
    }
    void operator()(const HoldPosition& h) const {
        for (const Chart& c : p.mechanism.charts) {
            if (c.kind == Chart::Kind::vector) {
                for (int k = 0; k < c.n; ++k) {
                    const int d = c.iv + k;
                    tau[d] = h.kp[d] * (h.q[c.iq + k] - q[c.iq + k]) - h.kd[d] * v[d];
                }
            } else if (c.kind == Chart::Kind::circle) {
                const double *x = q.data() + c.iq, *y = h.q.data() + c.iq;
                const double gap = std::atan2(x[0] * y[1] - x[1] * y[0], x[0] * y[0] + x[1] * y[1]);
                tau[c.iv] = h.kp[c.iv] * gap - h.kd[c.iv] * v[c.iv];
            } else {
                const int n = c.kind == Chart::Kind::pose ? 6 : 3;
                for (int k = 0; k < n; ++k) tau[c.iv + k] = -h.kd[c.iv + k] * v[c.iv + k];
            }
        }
    }
    void operator()(const TorqueTable& table) const {
        tau.setZero();
        add_torques(table, t, tau);
    }
};

}  // namespace

void demanded_torque(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& tau) {
    if (w.now.has_override) {
        tau = w.now.override_torque;
        return;
    }
    std::visit(Torque{p, w, t, q, v, tau}, p.actuation);
    if (!p.added_torque.times.empty()) add_torques(p.added_torque, t, tau);
}

void given_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    demanded_torque(p, w, t, q, v, w.now.tau);
    if (p.limits_effort()) w.now.tau = w.now.tau.cwiseMax(p.min_effort).cwiseMin(p.max_effort);
    w.now.external.setZero();
    w.now.joint_external.setZero();
    if (p.forces.empty()) return;
    const Apply apply{p, w, t, q, v};
    if (p.has_body_forces) std::fill(w.now.body_force.begin(), w.now.body_force.end(), Force{Vec3::Zero(), Vec3::Zero()});
    for (const GivenForce& f : p.forces) std::visit(apply, f);
    if (!p.mechanism.deep_dofs.empty()) w.now.joint_external = w.now.external;
    if (!p.has_body_forces) return;
    // Propagate from the leaves to the root: each joint carries the forces on its subtree.
    std::copy(w.now.body_force.begin(), w.now.body_force.end(), w.scratch.subtree_force.begin());
    for (int i = static_cast<int>(p.mechanism.joints.size()) - 1; i > 0; --i) {
        const Joint& j = p.mechanism.joints[i];
        for (int k = j.iv; k < j.iv + j.nv; ++k) w.now.external[k] += dot(w.now.terms.J[k], w.scratch.subtree_force[i]);
        if (j.parent == 0) continue;
        const Force& f = w.scratch.subtree_force[i];
        w.scratch.subtree_force[j.parent] += j.deep ? before(f, w.now.terms.deep.shift[i]) : f;
    }
}

}  // namespace pn
