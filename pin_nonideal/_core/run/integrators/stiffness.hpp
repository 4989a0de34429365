// Guard against stiff runs. In a stiff run stability of the explicit method limits the steps, although the motion is
// smooth. More steps are then left than the run may take.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class StiffnessGuard {
public:
    // A stiff run may take as many steps as the options allow, or a default number.
    StiffnessGuard(System& system, Stepper& stepper, Progress& progress, const Options& options);

    // Check stiffness after a step that the error control accepts. The workspace is evaluated at the step's end before
    // and after. Throw a Failure with the stiff dof and its rate [1/s]. Call the hint of the options if a fast motion
    // makes the run slow, but not endless.
    void look();
    // Restart the step count for a new run.
    void forget();
    // Throw the same Failure at once if the fastest decaying mode is too fast for time steps of this size.
    void require_time_steps(double size);

private:
    struct FastestMode {
        double decay, frequency;  // [1/s]
        int dof;                  // dof whose force contributes most to the mode
        double rate() const;
        bool decays() const;
    };

    void look_for_border();
    void look_ahead();
    // Return the fastest mode at the step's end. The workspace is evaluated at the step's end before and after.
    FastestMode mode_here();
    double stage_rate() const;
    VecX difference(double relative, const VecX& direction, VecX& force);
    FastestMode fastest_mode(double relative);  // `relative`: difference step relative to the state

    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const Options& options_;
    const double most_steps_;
    Clock::time_point start_time_;
    long steps_, next_look_ahead_;
    VecX probe_, probe_rate_;
};

}  // namespace pn
