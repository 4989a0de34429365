// Which samples a run leaves: every accepted step or those of an even grid, and both ends and each event.
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
    // The state now, whose velocity is about to jump: another sample of the same time follows.
    void before_jump();
    // The state now, at which the workspace is evaluated.
    void now();
    // At the end of a step that changed no modes: a sample where one is due, or asked for.
    void end_step(bool asked);
    // The same of a step of time stepping, whose end is near the grid's.
    void end_time_step();
    // Samples of the grid inside the step just taken, and one at a time between.
    void inside_step(std::optional<double> between);
    // The interpolant of the step just taken, where it is recorded; of a step of time stepping, that began in another
    // state, a straight line. The workspace is left as it was.
    void keep_step();
    void keep_time_step(double from, const VecX& y_from);
    // The workspace is configured at the state now.
    void configured_now();

private:
    void emit(double at, const VecX& state, bool evaluated);
    // A sample inside the step just taken, from its interpolant. Leaves the workspace there.
    void emit_between(double at);
    void choose_as_before(double at);
    // Calls `look`, which may leave the workspace anywhere inside the step just taken, and puts it back to the step's end.
    template <class Look>
    void look_inside(const Look& look);

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
    RowChoice choice_;  // of the step around a sample
    RunState kept_;  // of the step's end, while the workspace is elsewhere
    bool jumps_ = false;  // after the last sample
};

}  // namespace pn
