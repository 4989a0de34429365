// Size of an error in a state beside what the tolerances allow, and the first step that they suggest.
#pragma once

#include "run/system.hpp"

namespace pn {

class ErrorNorm {
public:
    // atol by tangent coordinate, velocity and state of a law.
    ErrorNorm(System& system, double rtol, const VecX& atol);

    // Errors that a step of size h between these states may make.
    void set_tolerances(const VecX& y0, const VecX& y1, double h);
    // Root mean square of dy at y, each coordinate as a part of its tolerance.
    double operator()(const VecX& dy, const VecX& y);
    // Step of a method of this order from y, where the rate is dy; `limit` at most. Leaves the workspace elsewhere.
    double initial_step(int order, double t, const VecX& y, const VecX& dy, double limit);

private:
    // Raises magnitudes to those of tangent coordinates, velocities and states at y.
    void magnitude(const VecX& y);

    System& system_;
    double rtol_, share_tolerance_ = 1.0;
    VecX atol_, tolerance_, tangent_;
};

}  // namespace pn
