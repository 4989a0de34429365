// The floor of the step control: an acceleration has rounding, and no step is short enough to meet a tolerance below it.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class RoundingFloor {
public:
    RoundingFloor(System& system, Stepper& stepper, ErrorNorm& norm, Progress& progress, Recording& out);

    // After a step that the error control accepts, with the workspace evaluated at its end, and left so: measures the
    // rounding of the rates now and then in runs of many steps. The norm takes it for part of the tolerance, as much as
    // lets rounding alone make the next step no shorter: noise, which would ask for shorter steps for ever, asks for none.
    void look();

private:
    void measure();

    System& system_;
    Stepper& stepper_;
    ErrorNorm& norm_;
    Progress& progress_;
    Recording& out_;
    double raised_ = 0.0;  // of the rounding of a rate, over the step, what its tolerance is raised to
    VecX change_, probe_, rate_, noise_;
};

}  // namespace pn
