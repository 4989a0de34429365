// Step of the method of a run. The scheme of the method is selected once.
#pragma once

#include <variant>

#include "run/integrators/slip_collocation.hpp"
#include "run/integrators/external_step.hpp"
#include "run/integrators/runge_kutta.hpp"
#include "run/integrators/semi_implicit_euler.hpp"

namespace pn {

class Stepper : public Step {
public:
    Stepper(const Method& method, System& system, ErrorNorm& norm);

    const Method& method;

    // Compute y1 by one step of size h from (t0, y0). The rate at the start must be set. If collocation fails, y1 = y0.
    void take(double t, double size);
    // Move the step's end by a time in which its rate stays constant. The rate at the end must be set. The
    // interpolant is discarded.
    void move_end(double dt);
    // Repeat the step with another length. Throw a Failure if it is not solved.
    void repeat(double size);
    // Repeat the step with another length, then project and evaluate its end.
    void end_at(double size);
    // Follow a step from t that an outside integrator has taken, and evaluate the rates inside.
    void follow(double t, double size, OutsideStep::Interpolant interpolant);
    // Return the norm of the error estimate, 1 at the tolerance, or 0 for methods without one.
    double error();
    // State of the last stage of an explicit Runge-Kutta method, until there is an interpolant.
    const VecX& last_stage() const { return std::get<RungeKutta>(scheme_).last_stage(); }
    // Store data from the projection of an accepted step's end, for methods that use it.
    void learn();

    // Interpolant of the states over the step, which needs the rate at the step's end. This leaves the workspace at other
    // states.
    void make_interpolant();
    void interpolate(double part, VecX& y) const;
    // Return one entry of the interpolant, or its rate. Unit lengths are not restored.
    double interpolated(double part, int index) const;
    double interpolated_rate(double part, int index) const;
    bool has_interpolant() const { return has_interpolant_; }

    // Check if the step solved for the directions of slip by collocation.
    bool collocates() const { return collocates_; }
    // Return a relaxation rate times the step: of slip directions after collocation, else of velocities, estimated from
    // the last two evaluations.
    double stiffness() const;
    // Restore the directions of the step's end after samples inside the step. `reset_warm_start` discards the warm start
    // for the next step.
    void end_directions() const { if (collocates_) collocation_.set_directions_at(1.0); }
    void reset_warm_start() { collocation_.reset_warm_start(); }

    // Rates of the step just taken, in order of time: at its start, at stages before its end, and at its end.
    struct RateSample {
        double part;
        const VecX* rate;
    };
    const std::vector<RateSample>& rate_samples() const { return collocates_ ? collocation_samples_ : rate_samples_; }

private:
    void stand();

    System& system_;
    ErrorNorm& norm_;
    std::variant<std::monostate, RungeKutta, SemiImplicitEuler, OutsideStep> scheme_;
    Collocation collocation_;
    std::vector<RateSample> rate_samples_, collocation_samples_;
    bool has_interpolant_ = false, collocates_ = false;
};

}  // namespace pn
