#include "run/stepped_run.hpp"

namespace pn {

void SteppedRun::begin(const VecX& q0, const VecX& v0, double period, bool only) {
    progress = at_first_;
    stepper.reset_warm_start();
    stiffness.reset();
    event.reset();
    open_loop.reset();
    choice.reset();
    out.steps = 0;  // the guards against runs without progress count from zero
    periods_ = 0;
    t_end = options.t0 + period;
    stops_there = only;
    start(q0, v0);
}

void SteppedRun::advance(double period) {
    progress.is_stationary = false;  // torques may have changed
    t_end = options.t0 + static_cast<double>(++periods_) * period;
    run();
}

}  // namespace pn
