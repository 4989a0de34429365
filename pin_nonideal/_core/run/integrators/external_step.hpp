// A step that an integrator outside the core has taken. Its interpolant is the integrator's, and the core looks at the
// rates at its ends and at the places of the method's C.
#pragma once

#include <cmath>
#include <functional>
#include <utility>

#include "run/integrators/method.hpp"
#include "run/integrators/step.hpp"

namespace pn {

class OutsideStep {
public:
    using Interpolant = std::function<void(double t, VecX& y)>;  // y without watch

    OutsideStep(const Method& method, Step& step) : method_(method), step_(step), inside_(step.y0) {}
    void set_interpolant(Interpolant interpolant) { interpolant_ = std::move(interpolant); }

    // y1 at the step's end, or at an earlier one.
    template <class System>
    void advance(System& system) {
        interpolate(1.0, step_.y1);
        system.normalize(step_.y1);
    }
    // The rates inside.
    template <class System>
    void look_inside(System& system) {
        for (int i = 1; i < method_.stages; ++i) {
            interpolate(method_.C[i], inside_);
            system.derivative(step_.t0 + method_.C[i] * step_.h, inside_, step_.rates[i]);
        }
    }
    template <class System>
    void make_interpolant(System&) {}
    void interpolate(double part, VecX& y) const { interpolant_(step_.t0 + part * step_.h, y); }
    // Its rate is not known.
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
