// Samples of a run: every accepted step or an even grid, plus both ends and each event.
#pragma once

#include <optional>

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class Output {
public:
    Output(System& system, Stepper& stepper, Progress& progress, const Options& options, Recording& out);

    void begin();
    double next() const { return options_.t0 + progress_.samples * options_.output_dt; }
    // Record the current state, whose velocity is about to jump. Another sample of the same time follows.
    void before_jump();
    // Record the current state, at which the workspace is evaluated.
    void now();
    // Record a sample at the end of a step without mode changes, if one is due or `is_needed` is true.
    void end_step(bool is_needed);
    // Check if a sample is due at the end of a step of time stepping, up to the rounding error of the end.
    bool is_due(double rounding) const;
    // Record this sample if it is due. `open_gaps`: gaps that are known to be open, per gap.
    void end_time_step(double rounding, const std::vector<char>* open_gaps);
    // Record samples of the grid inside the step just taken, and one at the time `between`.
    void inside_step(std::optional<double> between);
    // Record the interpolant of the step just taken, if dense output is on. A step of time stepping, or the end of
    // bouncing, from another state is recorded as a straight line. The workspace is restored.
    void keep_step();
    void keep_time_step(const DenseRecorder::StepStart& start, double impact_energy_from);
    // Store that the workspace is configured at the current state.
    void configured_now();

private:
    void emit(double time, const VecX& state, bool evaluated, const std::vector<char>* open_gaps = nullptr);
    bool is_on_grid(double rounding) const;
    // Record a sample inside the step just taken, from its interpolant. This leaves the workspace at the sample.
    void emit_between(double time);
    void choose_as_before(double time);
    // Call `visit`, which may leave the workspace at any state of the step just taken, then restore the workspace at the
    // step's end.
    template <class Visit>
    void evaluate_inside(const Visit& visit);

    const Program& p;
    Workspace& w;
    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const Options& options_;
    Recording& out_;
    Recorder recorder_;
    DenseRecorder dense_;
    VecX sample_;
    RowChoice choice_;  // choice of rows of the step around a sample
    RunState kept_;  // run state of the step's end, during samples inside the step
    bool jumps_ = false;  // the velocity jumps after the last sample
};

}  // namespace pn
