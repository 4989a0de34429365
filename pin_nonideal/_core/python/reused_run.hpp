// A run that is carried again and again in one workspace: what it works in is made once.
#pragma once

#include <memory>
#include <utility>

#include "python/reused_workspace.hpp"
#include "run/stepped_run.hpp"

namespace pn {

class KeptRun {
public:
    // From a state to the end, in a workspace that is as good as new; `first`: the state of a new one. Program, workspace
    // and options are those of the first call until `forget`. What the run leaves lies in `out` until the next.
    void carry(const Program& p, Workspace& w, const RunState& first, const Options& options, const VecX& q0,
               const VecX& v0) {
        clear_samples();
        clear(p, w, first);
        try {
            if (!run_) run_ = std::make_unique<SteppedRun>(p, w, options, out);
            run_->begin(q0, v0, options.duration, true);
            run_->run();
        } catch (const Failure& failure) {
            out.failure = failure;
        } catch (...) {
            out.error = std::current_exception();
        }
        if (out.failure || out.error) forget();  // it is no place to go on from
    }

    void forget() { run_.reset(); }

    // The room of samples of states is kept for the next run, unless they were taken away.
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

// One thread's room: a workspace with the state of a new one, and the run that works in it, used again and again.
struct Room {
    std::unique_ptr<Workspace> own;
    RunState first;
    KeptRun run;

    // `anew`: nothing of the runs before is used again.
    void carry(const Program& p, const Options& options, bool anew, const VecX& q0, const VecX& v0) {
        if (!own || anew) {
            run.forget();
            own = std::make_unique<Workspace>(p);
            first = own->state;
        }
        run.carry(p, *own, first, options, q0, v0);
    }
};

}  // namespace pn
