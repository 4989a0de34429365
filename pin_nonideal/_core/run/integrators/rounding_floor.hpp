// Lower bound on the tolerances of the step control, since no step has an error below the rounding error of accelerations.
#pragma once

#include "run/output/checkpoint.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

struct RoundingFloorParameters {
    // Number of steps from which rounding is measured, and steps between two measurements (seven evaluations each).
    // Noise that requires ever shorter steps causes runs of so many steps. In most shorter runs rounding is far below
    // the tolerances, so they omit the measurement.
    long min_measured_steps = 20000, steps_between_measurements = 64;
    // Safety factor on a measurement, which is only a sample. Fraction of the previous value that bounds the next one from
    // below.
    double sample_factor = 3.0, lasting_part = 0.5;
    double max_spacings = 16.0;  // maximum change of a state in a sample, in floating-point spacings
    int samples = 3;             // changed states of a measurement
};

class RoundingFloor {
public:
    using Parameters = RoundingFloorParameters;
    static constexpr Parameters parameters{};

    RoundingFloor(System& system, Stepper& stepper, ErrorNorm& norm, Progress& progress, Recording& out);

    // Measure the rounding error of the rates at intervals, in runs with many steps. Call it after a step that the error
    // control accepts. The workspace is evaluated at the step's end before and after the call. The norm raises the tolerance
    // by the rounding, so that noise alone does not shorten the next step.
    void check_step();

private:
    void measure();

    System& system_;
    Stepper& stepper_;
    ErrorNorm& norm_;
    Progress& progress_;
    Recording& out_;
    double tolerance_factor_ = 0.0;  // factor from the rounding error of a rate to the raised tolerance, per step
    VecX change_, probe_, rate_, noise_;
};

}  // namespace pn
