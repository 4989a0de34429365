// Torques that change between two steps: of sampled control, of a callback, or of a caller. Each jump ends a step, and
// the rate is taken anew behind it.
#pragma once

#include "run/events/breaks.hpp"

namespace pn {

class Torques {
public:
    Torques(System& system, Progress& progress, const Options& options, Output& output, Breaks& breaks);

    // Behind a break of functions of time that was reached: a step of time stepping finds velocities that jump itself.
    void enter() { if (breaks_.reached()) breaks_.enter(); }
    // Of sampled control, where its next period begins now.
    void sample();
    // Of the callback, where it gives some; whether the run goes on.
    bool ask_callback();
    // In place of the actuation's from here on.
    void set(const VecX& torque);
    // The next time at which actuation jumps or bends, or a function of time breaks; the end of the run at most.
    double next_stop(double t_end) const;

private:
    void take_rate_anew();

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& now_;
    const Options& options_;
    Output& output_;
    Breaks& breaks_;
};

// Number of whole lengths in a time that should be a multiple of them, but for rounding.
double whole_lengths(double time, double length);

}  // namespace pn
