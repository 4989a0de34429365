// Which stepper takes the next step where slip turns: collocation as long as directions of slip relax fast beside the
// step, else the method asked for, until its stability has held the steps short several times in a row.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class StepperChoice {
public:
    StepperChoice(System& system, Stepper& stepper, Progress& progress, const Options& options);

    // At the step just taken, whose end is evaluated: whether stability held it short.
    void look();
    // For the next step.
    void choose();
    void forget() { turns_stiffly_ = false; }

private:
    Workspace& w;
    System& system_;
    Stepper& stepper_;
    Progress& now_;
    const Options& options_;
    bool turns_stiffly_ = false;  // the step just taken
};

}  // namespace pn
