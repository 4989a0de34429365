// Choice of the stepper while slip turns. Collocation is used as long as slip directions relax fast relative to the
// step. Otherwise the selected method is used, until its stability has limited several steps in a row.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class StepperChoice {
public:
    StepperChoice(System& system, Stepper& stepper, Progress& progress, const Options& options);

    // Check if stability limited the step just taken, whose end is evaluated.
    void look();
    // Select the stepper of the next step.
    void choose();
    void forget() { is_stiff_ = false; }

private:
    Workspace& w;
    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const Options& options_;
    bool is_stiff_ = false;  // stability limited the step just taken
};

}  // namespace pn
