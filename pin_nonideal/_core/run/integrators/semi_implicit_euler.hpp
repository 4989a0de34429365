// Semi-implicit Euler: v1 = v0 + h a(q0, v0), and q1 is q0 moved by h v1, near the constraints; states of laws and work
// by Euler's rule. Order 1.
#pragma once

#include <utility>

#include "run/integrators/step.hpp"
#include "run/integrators/system.hpp"

namespace pn {

class SemiImplicitEuler {
public:
    explicit SemiImplicitEuler(Step& step) : step_(step), delta_(step.y0) {}

    // y1, from y0 and the rate there; the workspace must be evaluated at y0.
    void advance(System& system);
    // What the projection of the step's end has shown helps the next step.
    void learn(System& system) const;

    // The interpolant is a line.
    void make_interpolant(System&) { delta_ = step_.y1 - step_.y0; }
    void interpolate(double part, VecX& y) const;
    std::pair<double, double> interpolated(double part, int index) const {
        return {step_.y0[index] + part * delta_[index], delta_[index]};
    }

private:
    Step& step_;
    VecX delta_;
};

}  // namespace pn
