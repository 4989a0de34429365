// Norm of a state error relative to the tolerances, and size of the first step. RungeKutta::error combines the norms of
// the two error estimates of dop853.
#pragma once

#include <limits>

#include "run/integrators/system.hpp"

namespace pn {

struct ErrorNormParameters {
    // Tolerance of the force of a sticking element over a step, relative to its limit.
    double share_part = 1e-4;
    // Rounding error of the force of a sticking element, relative to the largest given force. A friction limit in a part of
    // a long chain without large loads may be as small as this rounding error.
    double stuck_force_rounding = 64 * std::numeric_limits<double>::epsilon();
    // Shortest step [s] that resolves a load. The error of a load that jumps does not decrease with the step, so
    // shorter steps skip it.
    double min_resolved_step = 1e-9;
    // Rounding error of a velocity, relative to the largest one. A joint that constraints drive slowly beside fast joints
    // has no digits below it at any step size.
    double velocity_rounding = 64 * std::numeric_limits<double>::epsilon();
    // Residuals below this multiple of the rounding error of a projection do not count as an error of a step.
    double residual_spacings = 8.0;
    // Rounding error of the time in a step's stages, in floating-point spacings. This rounding shifts prescribed motions.
    double time_spacings = 4.0;
    // First step [Hairer, Norsett, Wanner, sec. II.4]. The move of Euler's rule is bounded relative to the size of the
    // state. The error of the method, estimated from the derivatives, is bounded relative to the tolerance.
    double first_part = 0.01;
    // Negligible norm of a state or rate, and the trial step [s] for it. Negligible second derivative, and the step for
    // it relative to the trial. Maximum growth over the trial.
    double nothing = 1e-5, smallest_trial = 1e-6, no_curvature = 1e-15, flat_part = 1e-3, max_trial_growth = 100.0;
};

class ErrorNorm {
public:
    using Parameters = ErrorNormParameters;
    static constexpr Parameters parameters{};

    // `atol` has one entry per tangent coordinate, velocity and law state. `rounding` of their rates has the same
    // layout and is the floor of the tolerances.
    ErrorNorm(System& system, double rtol, const VecX& atol, const VecX& rounding);

    // Set the tolerances of a step of size h between these states.
    void set_tolerances(const VecX& y0, const VecX& y1, double h);
    // Check if rounding exceeds the tolerances.
    bool is_limited() const { return limited_; }
    // Raise the rounding error of each rate to the size of dy.
    void raise(VecX& rounding, const VecX& dy, const VecX& y);
    // Return the root mean square of dy at y, each coordinate relative to its tolerance.
    double operator()(const VecX& dy, const VecX& y);
    // Return the same norm for the move of a step's end by a projection. The norm includes velocities only if stages are not
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
    // Raise the magnitudes to at least the absolute values of tangent coordinates, velocities and law states at y.
    void magnitude(const VecX& y);

    System& system_;
    double rtol_, share_tolerance_ = 1.0, share_rounding_ = 0.0;
    bool resolves_shares_ = true;  // the step is long enough to resolve contact loads
    VecX atol_, tolerance_, tangent_;
    const VecX& rounding_;
    bool limited_ = false;
};

}  // namespace pn
