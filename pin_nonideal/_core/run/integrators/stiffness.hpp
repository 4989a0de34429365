// Guard against stiff runs. In a stiff run stability of the explicit method limits the steps, although the motion is
// smooth. More steps are then left than the run may take.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

struct StiffnessGuardParameters {
    // Maximum number of remaining steps of a stiff run if max_steps is not set (some seconds).
    double usual_steps = 1e5;
    // Steps near the limit of stability until stiffness is checked. `quiet_steps` steps in a row away from the limit
    // reset the count. [Hairer, Wanner, Solving ODEs II, IV.2, checks after 15]
    long suspicious_steps = 1000, quiet_steps = 6;
    // Fraction of the stability limit beyond which a step counts as stiff. On average, error control keeps the steps of a
    // stiff run at this fraction.
    double near_border = 0.5;
    // Stability limit of Euler's rule, which time stepping applies to decaying motions.
    double euler_border = 2.0;
    // Minimum decay of a mode that counts as decaying, relative to its rate. Other modes oscillate, and every method
    // must follow them.
    double min_damping = 0.1;
    double difference_step = 1e-8;  // relative step of differences: root of the unit roundoff
    int power_passes = 20;          // passes of the power iteration
    // Shorter relative step, and minimum ratio of the rates by both steps. The rate of a jump, as of a load whose
    // contact point changes, grows as the step shrinks. This rate vanishes if the step does not reach the jump.
    double shorter_step = 1e-9, same_rate = 0.5;
    // Step count at which the remaining time is first estimated, doubled each time, and a step count past all runs.
    long first_estimate_steps = 500, no_estimate_steps = 1L << 62;
    double long_time = 3.0;  // remaining wall time [s] from which a run is slow
    // A slow run vibrates if this phase [rad] is left, and if a step covers more than `part_of_period` [rad].
    double many_radians = 2e4, part_of_period = 0.1;
};

class StiffnessGuard {
public:
    using Parameters = StiffnessGuardParameters;
    static constexpr Parameters parameters{};

    // A stiff run may take as many steps as the options allow, or a default number.
    StiffnessGuard(System& system, Stepper& stepper, Progress& progress, const Options& options);

    // Check stiffness after a step that the error control accepts. The workspace stays evaluated at the step's end. Throw a
    // Failure with the stiff dof and its rate [1/s]. Call the hint of the options if a fast motion makes the run slow, but
    // not endless.
    void check_step();
    // Restart the step count for a new run.
    void reset();
    // Throw the same Failure at once if the fastest decaying mode is too fast for time steps of this size.
    void require_time_steps(double size);

private:
    struct FastestMode {
        double decay, frequency;  // [1/s]
        int dof;                  // dof whose force contributes most to the mode
        double rate() const;
        bool decays() const;
    };

    void check_stability_limit();
    void estimate_remaining_time();
    // Return the fastest mode at the step's end, in a workspace of its own: the instant of an estimate depends on the clock,
    // and the run must not.
    FastestMode mode_here();
    double stage_rate() const;
    VecX difference(System& system, double relative, const VecX& direction, VecX& force);
    FastestMode fastest_mode(System& system, double relative);  // `relative`: difference step relative to the state

    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const Options& options_;
    const double max_steps_;
    Clock::time_point start_time_;
    long steps_, next_estimate_steps_;
    VecX probe_, probe_rate_;
};

}  // namespace pn
