// A run that its caller takes period by period, with torques of its own: each period begins where the last one ended,
// with the steps, modes and factors that it left.
#pragma once

#include "run/simulation.hpp"

namespace pn {

class SteppedRun : public Simulation {
public:
    using Simulation::Simulation;

    // From a state on, at the time that the options say, for a first period; nothing is left of what was before. `only`:
    // no other period follows, so that its end needs no acceleration where nothing records one.
    void begin(const VecX& q0, const VecX& v0, double period, bool only);
    // Torques in place of the actuation's from here on; the derivative is taken anew.
    void set_torque(const VecX& torque) { torques.set(torque); }
    // To the end of the next period.
    void advance(double period);

    double time() const { return t; }
    const VecX& state() const { return y; }

private:
    const Progress at_first_ = *this;
    long periods_ = 0;
};

}  // namespace pn
