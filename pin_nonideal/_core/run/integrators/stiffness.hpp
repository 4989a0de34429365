// Whether a run crawls because it is stiff: its steps are as long as an explicit method is stable, however smooth the
// motion, and more of them are left than it may take.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class StiffnessGuard {
public:
    // A stiff run may take as many steps as the options allow, or the usual number of them.
    StiffnessGuard(System& system, Stepper& stepper, Progress& progress, const Options& options);

    // After a step that the error control accepts, with the workspace evaluated at its end, and left so. Throws a Failure
    // with the dof that is stiff, and its rate [1/s]. What will take long for a fast motion, but not for ever, is hinted at.
    void look();
    // A run begins, at which the count of steps does.
    void forget();
    // The same at once, unless what decays fastest lets time stepping take steps of this size.
    void require_time_steps(double size);

private:
    struct FastestMode {
        double decay, frequency;  // [1/s]
        int dof;                  // whose force does most to it
        double rate() const;
        bool decays() const;
    };

    void look_for_border();
    void look_ahead();
    // Of the motion at the step's end, which the workspace is at before and after.
    FastestMode mode_here();
    double stage_rate() const;
    VecX difference(double relative, const VecX& direction, VecX& force);
    FastestMode fastest_mode(double relative);  // by differences of so small a part of the state

    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const Options& options_;
    const double most_steps_;
    Clock::time_point begun_;
    long steps_, next_look_ahead_;
    VecX probe_, probe_rate_;
};

}  // namespace pn
