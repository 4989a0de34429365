// Springs, dampers, smooth friction and position control of single dofs, which time steps take implicitly.
//
// Bristles of a LuGre law follow the exact solution for a constant velocity. The mean deflection over the step, or the
// deflection at its end, replaces the deflection at its start.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct JointDrivesParameters {
    // Difference of speeds that gives the slope of a smooth friction law, relative to the speed at which it changes.
    double slope_difference = 1e-6;
};

class JointDrives {
public:
    using Parameters = JointDrivesParameters;
    static constexpr Parameters parameters{};

    explicit JointDrives(const Program& p);

    // Check if the scene has such forces.
    bool any() const { return any_; }
    // Check if a dof has a spring or damper, besides smooth friction.
    bool acts_on(int dof) const { return stiffness_[dof] != 0.0 || damping_[dof] != 0.0; }
    // Implicit forces during a step of length h from (t, q0, v0), until the object ends. Position control whose torque is
    // at its limit stays explicit.
    enum class Deflection { mean, end };
    class Step {
    public:
        Step(const JointDrives& drives, const Program& p, Workspace& w, double t, double h, const VecX& q0,
             const VecX& v0, Deflection deflection = Deflection::mean);
        Step(const Step&) = delete;
        ~Step() { w_.now.drives.active = false; }

        // Set the velocity at which the forces are taken.
        void move(const VecX& v0, const VecX& v);
        // Set the deflections z of bristles at the step's end, at the velocity v.
        void end_deflections(const VecX& v, Eigen::Ref<VecX> z) const;
        // Return the energy that the implicit part of the forces added in the step from v0 to v1.
        double energy(const VecX& v0, const VecX& v1) const;

    private:
        double slope(const LuGre& law, double speed) const;
        double deflection(const LuGre& law, double speed) const;

        const JointDrives& all_;
        Workspace& w_;
        double h_;
        Deflection deflection_;
        VecX z0_;  // states of the laws at the step's start
    };

private:
    bool any_ = false;
    bool controls_position_ = false;  // some gain of the position control is not zero
    VecX stiffness_, damping_;  // sums over all drives
    VecX kp_, kd_;              // gains of the position control
    std::vector<LuGre> bristles_;
    std::vector<Sigmoid> sigmoids_;
};

}  // namespace pn
