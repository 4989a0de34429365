// Run that the caller advances period by period, with its own torques. Each period starts from the state, step size,
// modes and factors that the last one left.
#pragma once

#include "run/simulation.hpp"

namespace pn {

class SteppedRun : public Simulation {
public:
    using Simulation::Simulation;

    // Start from (q0, v0) at time `options.t0` for a first period, and discard the previous state. `only`: no other
    // period follows, so the final acceleration is skipped if nothing records it.
    void begin(const VecX& q0, const VecX& v0, double period, bool only);
    // Replace the actuation torques from now on, and recompute the rate.
    void set_torque(const VecX& torque) { torques.set(torque); }
    // Integrate to the end of the next period.
    void advance(double period);

    double time() const { return progress.t; }
    const VecX& state() const { return progress.y; }

private:
    const Progress at_first_ = progress;  // before the first start
    long periods_ = 0;
};

}  // namespace pn
