// Norm of a state error relative to the tolerances, and size of the first step.
#pragma once

#include "run/integrators/system.hpp"

namespace pn {

class ErrorNorm {
public:
    // `atol` has one entry per tangent coordinate, velocity and law state. `rounding` of their rates has the same
    // layout and is the floor of the tolerances.
    ErrorNorm(System& system, double rtol, const VecX& atol, const VecX& rounding);

    // Set the tolerances of a step of size h between these states.
    void set_tolerances(const VecX& y0, const VecX& y1, double h);
    // Check if rounding exceeds the tolerances.
    bool is_limited() const { return limited_; }
    // Raise the rounding of each rate to the size of dy.
    void raise(VecX& rounding, const VecX& dy, const VecX& y);
    // Return the root mean square of dy at y, each coordinate relative to its tolerance.
    double operator()(const VecX& dy, const VecX& y);
    // Return the same norm for the move of a step's end by a projection. It includes velocities only if stages are not
    // projected. No component is removed.
    double of_projection(const VecX& dy, const VecX& y0, const VecX& y1, double t, double h);
    // Return a speed relative to the tolerance of the largest velocity, which set_tolerances has set.
    double of_speed(double speed) const;
    // Return the first step of a method of this order from the state y with rate dy, at most `limit`. Leaves the
    // workspace at another state.
    double initial_step(int order, double t, const VecX& y, const VecX& dy, double limit);

private:
    // Convert dy at y to tangent coordinates.
    void to_tangent(const VecX& dy, const VecX& y);
    // Raise the magnitudes to the sizes of tangent coordinates, velocities and law states at y.
    void magnitude(const VecX& y);

    System& system_;
    double rtol_, share_tolerance_ = 1.0, share_rounding_ = 0.0;
    bool resolves_shares_ = true;  // the step is long enough to resolve contact loads
    VecX atol_, tolerance_, tangent_;
    const VecX& rounding_;
    bool limited_ = false;
};

}  // namespace pn
