// Choice of the stepper while slip turns. Collocation is used as long as slip directions relax fast relative to the
// step. Otherwise the selected method is used, until its stability has limited several steps in a row.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

struct StepperChoiceParameters {
    // Relaxation rate of slip directions, times the step, from which stability limits explicit methods (at 3 to 6).
    double stiff_rate = 2.5;
    int stiff_in_a_row = 6;  // number of such steps after which collocation begins
    int patience = 20;       // steps after the end of collocation before the count begins again
};

class StepperChoice {
public:
    using Parameters = StepperChoiceParameters;
    static constexpr Parameters parameters{};

    StepperChoice(System& system, Stepper& stepper, Progress& progress, const Options& options);

    // Check if stability limited the step just taken, whose end is evaluated.
    void check_step();
    // Select the stepper of the next step.
    void choose();
    void reset() { is_stiff_ = false; }

private:
    Workspace& w;
    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const Options& options_;
    bool is_stiff_ = false;  // stability limited the step just taken
};

}  // namespace pn
