#include "run/integrators/joint_drives.hpp"

#include <algorithm>

#include "dynamics/given_forces.hpp"

namespace pn {

JointDrives::JointDrives(const Program& p) {
    const Mechanism& m = p.mechanism;
    stiffness_ = damping_ = kp_ = kd_ = VecX::Zero(m.nv);
    if (const auto* hold = std::get_if<HoldPosition>(&p.actuation)) {
        kd_ = hold->kd;
        for (const Chart& c : m.charts)
            if (c.kind == Chart::Kind::vector || c.kind == Chart::Kind::circle)
                kp_.segment(c.iv, c.kind == Chart::Kind::vector ? c.n : 1) =
                    hold->kp.segment(c.iv, c.kind == Chart::Kind::vector ? c.n : 1);
    }
    for (const GivenForce& force : p.forces)
        if (const auto* spring = std::get_if<JointSpring>(&force)) {
            stiffness_[m.joints[spring->joint].iv] += spring->stiffness;
            damping_[m.joints[spring->joint].iv] += spring->damping;
        }
    each_law<Viscous>(p.laws, [&](const Viscous& law) {
        if (law.block < 0) damping_.segment(law.dof, law.count).array() += law.coefficient;
    });
    for (int dof = 0; dof < m.nv; ++dof) {
        // Forces that drive motion stay explicit, and so do forces in deep trees, for which M has no entries.
        for (VecX* x : {&stiffness_, &damping_, &kp_, &kd_})
            if (m.is_deep[dof] || !((*x)[dof] > 0.0)) (*x)[dof] = 0.0;
    }
    stiffness_ += kp_;
    damping_ += kd_;
    controls_position_ = (kp_.array() != 0.0).any() || (kd_.array() != 0.0).any();
    each_law<LuGre>(p.laws, [&](const LuGre& law) {
        if (!m.is_deep[law.dof]) bristles_.push_back(law);
    });
    each_law<Sigmoid>(p.laws, [&](const Sigmoid& law) {
        if (!m.is_deep[law.dof] && law.phi1 != 0.0) sigmoids_.push_back(law);
    });
    any_ = (stiffness_.array() != 0.0).any() || (damping_.array() != 0.0).any() || !bristles_.empty() || !sigmoids_.empty();
}

JointDrives::Step::Step(const JointDrives& drives, const Program& p, Workspace& w, double t, double h, const VecX& q0,
                        const VecX& v0, Deflection deflection)
    : all_(drives), w_(w), h_(h), deflection_(deflection) {
    ImplicitDrives& step = w.now.drives;
    step.active = false;
    if (!drives.any_) return;
    step.h = h;
    step.stiffness = drives.stiffness_;
    step.damping = drives.damping_;
    step.theta.resize(v0.size());
    step.inertia.resize(v0.size());
    step.force.setZero(v0.size());
    z0_ = w.state.z;
    for (const LuGre& law : drives.bristles_)
        step.damping[law.dof] += std::max(0.0, slope(law, v0[law.dof]));
    for (const Sigmoid& law : drives.sigmoids_)
        step.damping[law.dof] += std::max(0.0, law.slope(v0[law.dof]));
    const bool is_limited = drives.controls_position_ && (w.now.has_override || p.limits_effort());
    if (is_limited && !w.now.has_override) demanded_torque(p, w, t, q0, v0, w.now.tau);
    for (int dof = 0; is_limited && dof < v0.size(); ++dof) {
        if (!w.now.has_override && w.now.tau[dof] > p.min_effort[dof] && w.now.tau[dof] < p.max_effort[dof]) continue;
        step.stiffness[dof] -= drives.kp_[dof];
        step.damping[dof] -= drives.kd_[dof];
    }
    step.active = true;
}

double JointDrives::Step::deflection(const LuGre& law, double speed) const {
    const double z0 = z0_[law.state];
    return deflection_ == Deflection::mean ? law.mean_deflection(speed, z0, h_) : law.deflection_after(speed, z0, h_);
}

// Change of the force of bristles with the speed.
double JointDrives::Step::slope(const LuGre& law, double speed) const {
    const auto force = [&](double u) { return law.resistance(u, deflection(law, u)); };
    const double difference = parameters.slope_difference * law.stribeck_velocity;
    return (force(speed + difference) - force(speed - difference)) / (2.0 * difference);
}

void JointDrives::Step::move(const VecX& v0, const VecX& v) {
    if (!w_.now.drives.active) return;
    w_.now.drives.set_velocity(v0, v);
    for (const LuGre& law : all_.bristles_) w_.state.z[law.state] = deflection(law, v[law.dof]);
}

void JointDrives::Step::end_deflections(const VecX& v, Eigen::Ref<VecX> z) const {
    for (const LuGre& law : all_.bristles_) z[law.state] = law.deflection_after(v[law.dof], z0_[law.state], h_);
}

double JointDrives::Step::energy(const VecX& v0, const VecX& v1) const {
    const ImplicitDrives& step = w_.now.drives;
    double energy = 0.0;
    if (!step.active) return energy;
    for (int dof = 0; dof < v0.size(); ++dof)
        energy += 0.5 * (v0[dof] + v1[dof]) * (step.h * step.force[dof] - step.inertia[dof] * (v1[dof] - v0[dof]));
    return energy;
}

}  // namespace pn
