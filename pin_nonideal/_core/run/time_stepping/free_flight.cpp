#include "run/time_stepping/free_flight.hpp"

#include <algorithm>

namespace pn {

namespace {

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

Matrix3d skew(const Vector3d& x) {
    Matrix3d m;
    m << 0.0, -x[2], x[1], x[2], 0.0, -x[0], -x[1], x[0], 0.0;
    return m;
}

// Solve J (w1 - w0) + h wm x J wm = h tau for w1. Returns false if Newton's method does not converge.
bool turn(const Matrix3d& J, const Vector3d& w0, const Vector3d& tau, double h, Vector3d& w1) {
    for (int step = 0; step < FreeFlight::parameters.max_newton; ++step) {
        const Vector3d mean = 0.5 * (w0 + w1), momentum = J * mean;
        const Vector3d error = J * (w1 - w0) + h * mean.cross(momentum) - h * tau;
        const Matrix3d slope = J + 0.5 * h * (skew(mean) * J - skew(momentum));
        const Vector3d change = slope.partialPivLu().solve(error);
        w1 -= change;
        if (!w1.allFinite()) return false;
        if (change.norm() <= FreeFlight::parameters.turn_rounding * w1.norm()) return true;
    }
    return false;
}

}  // namespace

FreeFlight::FreeFlight(const Program& p, const JointDrives& drives) : flight_(p.mechanism.nv, -1) {
    const Mechanism& m = p.mechanism;
    std::vector<char> parents(m.joints.size(), 0), joined(m.nv, 0);
    for (const Joint& joint : m.joints) parents[joint.parent] = 1;
    std::vector<char> opens(p.blocks.size(), 0);
    for (const Gap& gap : p.gaps) {
        opens[gap.block] = 1;
        for (int e : gap.elements) opens[p.frictions[e].block] = 1;
    }
    for (size_t i = 0; i < p.blocks.size(); ++i)
        if (!opens[i])
            for (int dof : p.blocks[i].support()) joined[dof] = 1;
    for (size_t i = 1; i < m.joints.size(); ++i) {
        const Joint& joint = m.joints[i];
        const bool lone = joint.kind == JointKind::free_flyer && joint.parent == 0 && !parents[i] && joint.mass > 0.0;
        if (!lone || std::any_of(&joined[joint.iv], &joined[joint.iv] + 6, [](char j) { return j != 0; })) continue;
        bool driven = false;
        for (int dof = joint.iv; dof < joint.iv + 6; ++dof) driven |= drives.acts_on(dof);
        if (driven || !(m.armature.segment(joint.iv, 6).array() == 0.0).all()) continue;
        flight_[joint.iv] = static_cast<int>(flights_.size());
        flights_.push_back({static_cast<int>(i), joint.iv, true, {}});
    }
}

void FreeFlight::begin() {
    for (Flight& flight : flights_) flight.free = true;
}

void FreeFlight::touch(const Block& block) {
    for (int dof : block.support())
        if (flight_[dof] >= 0) flights_[flight_[dof]].free = false;
}

void FreeFlight::move(const Program& p, const Workspace& w, double h, const double* q0, const VecX& v0, const VecX& mean,
                      VecX& v1) {
    for (Flight& flight : flights_) {
        if (!flight.free) continue;
        const Joint& joint = p.mechanism.joints[flight.joint];
        const Vector3d com = joint.com.eigen();
        const Matrix3d J = joint.inertia.eigen();
        const Eigen::Map<const Vector3d> from(q0 + joint.iq);
        const Eigen::Map<const Quaterniond> R0(q0 + joint.iq + 3), Rm(w.now.terms.q.data() + joint.iq + 3);
        // Forces other than the inertia forces at the mean velocity, in the axes of the body.
        const Vector3d v = mean.segment<3>(joint.iv), omega = mean.segment<3>(joint.iv + 3);
        const Vector3d momentum = joint.mass * (v + omega.cross(com)), spin = J * omega + com.cross(momentum);
        Vector3d force = w.now.F.segment<3>(joint.iv), moment = w.now.F.segment<3>(joint.iv + 3);
        if (p.has_laws()) {
            force += w.now.C.segment<3>(joint.iv);
            moment += w.now.C.segment<3>(joint.iv + 3);
        }
        force += omega.cross(momentum);
        moment += omega.cross(spin) + v.cross(momentum) - com.cross(force);
        const Vector3d w0 = v0.segment<3>(joint.iv + 3);
        Vector3d w1 = v1.segment<3>(joint.iv + 3);
        if (!turn(J, w0, moment, h, w1)) {
            flight.free = false;
            continue;
        }
        const Vector3d half = 0.25 * h * (w0 + w1);
        const Quaterniond R1 = (R0 * Quaterniond(1.0, half[0], half[1], half[2])).normalized();
        const Vector3d u0 = R0 * (v0.segment<3>(joint.iv) + w0.cross(com)), u1 = u0 + h / joint.mass * (Rm * force);
        const Vector3d to = from + R0 * com + 0.5 * h * (u0 + u1) - R1 * com;
        v1.segment<3>(joint.iv) = R1.conjugate() * u1 - w1.cross(com);
        v1.segment<3>(joint.iv + 3) = w1;
        std::copy(to.data(), to.data() + 3, flight.q);
        std::copy(R1.coeffs().data(), R1.coeffs().data() + 4, flight.q + 3);
    }
}

void FreeFlight::place(const Program& p, double* q1) const {
    for (const Flight& flight : flights_)
        if (flight.free) std::copy(flight.q, flight.q + 7, q1 + p.mechanism.joints[flight.joint].iq);
}

}  // namespace pn
