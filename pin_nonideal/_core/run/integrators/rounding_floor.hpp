// Floor of the step control. Accelerations have rounding, and no step is short enough to meet a tolerance below it.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class RoundingFloor {
public:
    RoundingFloor(System& system, Stepper& stepper, ErrorNorm& norm, Progress& progress, Recording& out);

    // Measure the rounding of the rates at intervals, in runs with many steps. Call it after a step that the error
    // control accepts. The workspace is evaluated at the step's end before and after. The norm raises the tolerance by
    // the rounding, so that noise alone does not shorten the next step.
    void look();

private:
    void measure();

    System& system_;
    Stepper& stepper_;
    ErrorNorm& norm_;
    Progress& progress_;
    Recording& out_;
    double tolerance_factor_ = 0.0;  // factor from the rounding of a rate to the raised tolerance, per step
    VecX change_, probe_, rate_, noise_;
};

}  // namespace pn
