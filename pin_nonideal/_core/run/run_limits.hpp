// Limits of a run on steps and wall time, with its progress reports and checkpoints.
#pragma once

#include "run/options.hpp"
#include "run/output/checkpoint.hpp"

namespace pn {

struct RunLimitsParameters {
    long early_steps = 20000;     // number of steps after which the progress is checked
    double min_progress = 1e-10;  // minimum progress, relative to the duration; slower runs raise a Failure
    // Number of steps between two progress reports.
    long steps_per_tick = 16;
};

class RunLimits {
public:
    using Parameters = RunLimitsParameters;
    static constexpr Parameters parameters{};

    RunLimits(const Options& options, Workspace& workspace, Progress& progress, Recording& out)
        : options_(options), w(workspace), progress_(progress), out_(out) {}
    ~RunLimits() { w.watch = nullptr; }
    RunLimits(const RunLimits&) = delete;
    RunLimits& operator=(const RunLimits&) = delete;

    // Report progress and check the wall time at evaluations too. A step may need many evaluations.
    void watch_evaluations();
    // Report progress, save a checkpoint if one is due, and check the limits, between two steps.
    void check();
    // Save a checkpoint if the run has a file for it.
    void save();

private:
    bool is_late() const;

    const Options& options_;
    Workspace& w;
    Progress& progress_;
    Recording& out_;
    long ticks_ = 0;
    Clock::time_point next_save_;
    const Clock::time_point start_time_ = Clock::now();
};

}  // namespace pn
