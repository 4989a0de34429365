// Run that is repeated in one workspace, with its objects made once.
#pragma once

#include <memory>
#include <utility>

#include "python/reused_workspace.hpp"
#include "run/stepped_run.hpp"
#include "run/whole_run.hpp"

namespace pn {

class ReusedRun {
public:
    // Run from a state to the end, in a workspace that is reset first. `first`: run state of a new workspace. All calls
    // until `reset` use the program, workspace and options of the first call. The results stay in `out` until the next
    // call.
    void run_from(const Program& p, Workspace& w, const RunState& first, const Options& options, const VecX& q0,
                  const VecX& v0) {
        clear_samples();
        reset_workspace(p, w, first);
        record_end(out, [&] {
            if (!run_) run_ = std::make_unique<SteppedRun>(p, w, options, out);
            run_->begin(q0, v0, options.duration, true);
            run_->run();
        });
        if (out.failure || out.error) reset();  // a stopped run cannot continue
    }

    void reset() { run_.reset(); }

    // Results. The memory of state samples is kept for the next run, unless the results were moved out.
    Recording out;

private:
    void clear_samples() {
        for (std::vector<double>* samples : {&out.t, &out.q, &out.v, &out.violation, &out.violation_rate, &out.z})
            samples->clear();
        out.modes.clear();
        out.closed.clear();
        out.events.clear();
        out.steps = out.rejected = out.limited = 0;
        out.rounding = 0.0;
        out.failure.reset();
        out.error = nullptr;
    }

    std::unique_ptr<SteppedRun> run_;
};

// Workspace of one thread with its initial run state, and a run in it. Both are used for many runs.
struct ThreadWorkspace {
    std::unique_ptr<Workspace> own;
    RunState first;
    ReusedRun run;

    // `anew`: make a new workspace and run.
    void run_from(const Program& p, const Options& options, bool anew, const VecX& q0, const VecX& v0) {
        if (!own || anew) {
            run.reset();
            own = std::make_unique<Workspace>(p);
            first = own->state;
        }
        run.run_from(p, *own, first, options, q0, v0);
    }
};

}  // namespace pn
