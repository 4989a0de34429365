// Semi-implicit Euler of order 1: v1 = v0 + h a(q0, v0). q1 is q0 moved by h v1, with a correction toward the
// constraints. Law states and work follow Euler's rule. Springs, dampers, smooth friction and position control of single
// dofs act implicitly, and the deflections of bristles follow v1.
#pragma once

#include <utility>

#include "run/integrators/joint_drives.hpp"
#include "run/integrators/step.hpp"
#include "run/integrators/system.hpp"

namespace pn {

class SemiImplicitEuler {
public:
    SemiImplicitEuler(Step& step, const Program& p) : step_(step), drives_(p), delta_(step.y0) {}

    // Compute y1 from y0 and the rate at y0. The workspace must be evaluated at y0.
    void advance(System& system);
    // Evaluate the workspace at y0 again, for a repeated step.
    void return_to_start(System& system);
    // Store the multipliers that the projection of the step's end has shown, for the next step.
    void learn(System& system) const;

    // The interpolant is linear.
    void make_interpolant(System&) { delta_ = step_.y1 - step_.y0; }
    void interpolate(double part, VecX& y) const;
    std::pair<double, double> interpolated(double part, int index) const {
        return {step_.y0[index] + part * delta_[index], delta_[index]};
    }

private:
    void take_drives_implicitly(System& system);

    Step& step_;
    JointDrives drives_;
    VecX delta_;
};

}  // namespace pn
