// Step of time stepping as part of a run. It locates no events, ends at torque jumps and due samples, and is recorded
// like any other step.
#pragma once

#include "run/time_stepping/moreau.hpp"
#include "run/events/warnings.hpp"
#include "run/torque_schedule.hpp"
#include "run/events/value_events.hpp"

namespace pn {

struct TimeSteppingParameters {
    // Shortest remainder of a step that becomes a step of its own, relative to the step.
    double min_remainder = 1e-9;
    // Shortest part of a step while edges approach each other, relative to the step.
    double min_cut = 1e-3;
};

class TimeStepping {
public:
    using Parameters = TimeSteppingParameters;
    static constexpr Parameters parameters{};

    TimeStepping(System& system, Progress& progress, GapWatch& watch, const Options& options, Torques& torques,
                 Output& output, Warnings& warnings, ValueEvents& value_events, Recording& out);

    // Set the closed contacts and the modes at the start of a run with unilateral contacts, and evaluate its motion.
    void begin(double size);
    // Take one step of this size, not beyond `stop` or the end of the run.
    void step(double size, double stop, double t_end);

private:
    void take(double end, double t_end);
    void stay_at_rest();
    void sample_event();
    void step_part(double end, double t_end, double least);
    void try_part(double h, double end, double t_end);
    bool needs_forces(double end, double t_end) const;
    double end_of_step(double size, double stop, double t_end) const;

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& progress_;
    const Options& options_;
    Torques& torques_;
    Output& output_;
    Warnings& warnings_;
    ValueEvents& value_events_;
    Recording& out_;
    ApproachingEdges edges_;
    Moreau moreau_;
    const bool is_autonomous_;  // a state that a step leaves unchanged stays unchanged
    double rounding_ = 0.0;  // difference of two times that count as the same end of a step
    const bool samples_every_step_;  // every step's end is a sample, or user code reads it
    // True if records or user code read accelerations and forces. Otherwise steps of separate trees do not evaluate
    // them.
    const bool reads_forces_;
    const System::SlipDirection directions_;
    const bool may_lack_motion_;  // the modes at a step's end may allow no motion
    VecX y_from_;
    Modes before_, before_step_;
    std::vector<char> closed_before_, closed_before_step_;
    VecX y_before_part_;
    Modes before_part_;
    std::vector<char> closed_before_part_;
    bool open_before_ = false;  // the stored modes have no closed contact and no active element
};

}  // namespace pn
