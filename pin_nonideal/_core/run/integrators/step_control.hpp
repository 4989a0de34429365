// Error control: acceptance of steps, and size of the next step.
#pragma once

#include <optional>

#include "dynamics/failure.hpp"
#include "run/integrators/method.hpp"

namespace pn {

// Error norm of a step that could not be evaluated. The next step is then as short as the control allows.
constexpr double failed_error = 1e4;

struct StepControlParameters {
    // The next step aims at error = safety^order. The change of the error from step to step then seldom rejects a step.
    // With 0.9 a third of the steps fails, and smooth motions need a sixth more evaluations for the same error. The
    // error of a rejected step is known, so the factor `retry_safety` of the next trial is closer to one.
    double safety = 0.65, retry_safety = 0.9;
    double min_step_ratio = 0.2, max_step_ratio = 10.0;  // least and largest ratio of two successive steps
    // A step is shortened by `detour` if an evaluation is nearer to a singular position than `clearance` times the
    // length of the step's path. The evaluations of the shortened step are at other positions.
    double clearance = 0.04, detour = 0.85;
    int max_detours = 3;  // maximum number of such steps in a row
};

// Earlier trials of the step.
struct StepTrials {
    bool last_rejected = false;  // the last trial was rejected
    int detours = 0;             // detours around a singular position
};

class StepControl {
public:
    using Parameters = StepControlParameters;
    static constexpr Parameters parameters{};

    StepControl(const Method& method, double rtol, StepTrials& trials) : method_(method), rtol_(rtol), trials_(trials) {}

    // Return the error norm at which the next step has the size of the last.
    static double aim(const Method& method);

    // Check if rounding near a singular position would spoil the stages of a step. A step of another length avoids the
    // position. Arguments: least pivot of the rows' factor at the stages, and its pivots at both ends.
    bool needs_detour(double min_pivot, double start_pivot, double end_pivot) const;
    // Check if a step of this size is accepted with this error norm (1 at the tolerance, none for a detour). Set h to
    // the size of the next step, or of its next trial. `last`: the step was cut at a stop.
    bool accepts(std::optional<double> error, double size, bool last, double& h);

private:
    const Method& method_;
    double rtol_;
    StepTrials& trials_;
};

}  // namespace pn
