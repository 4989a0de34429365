// Step taken by an integrator outside the core, with that integrator's interpolant. The core evaluates rates at the
// step's ends and at the abscissas C of the method.
#pragma once

#include <cmath>
#include <functional>
#include <utility>

#include "run/integrators/method.hpp"
#include "run/integrators/step.hpp"

namespace pn {

class OutsideStep {
public:
    using Interpolant = std::function<void(double t, VecX& y)>;  // y without the watch entries

    OutsideStep(const Method& method, Step& step) : method_(method), step_(step), inside_(step.y0) {}
    void set_interpolant(Interpolant interpolant) { interpolant_ = std::move(interpolant); }

    // Compute y1 at the step's end, or at an earlier end.
    template <class System>
    void advance(System& system) {
        interpolate(1.0, step_.y1);
        system.normalize(step_.y1);
    }
    // Evaluate the rates inside the step.
    template <class System>
    void evaluate_inside(System& system) {
        for (int i = 1; i < method_.stages; ++i) {
            interpolate(method_.C[i], inside_);
            system.derivative(step_.t0 + method_.C[i] * step_.h, inside_, step_.rates[i]);
        }
    }
    template <class System>
    void make_interpolant(System&) {}
    void interpolate(double part, VecX& y) const { interpolant_(step_.t0 + part * step_.h, y); }
    // Return one entry of the interpolant, and NaN for its unknown rate.
    std::pair<double, double> interpolated(double part, int index) const {
        interpolate(part, inside_);
        return {inside_[index], NAN};
    }

private:
    const Method& method_;
    Step& step_;
    mutable VecX inside_;
    Interpolant interpolant_;
};

}  // namespace pn
