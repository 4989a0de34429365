// Torques that change between two steps: by sampled control, by a callback, or by the caller. Each jump ends a step,
// and the rate is recomputed after it.
#pragma once

#include "run/events/breaks.hpp"

namespace pn {

struct TorqueScheduleParameters {
    // Rounding tolerance of the number of periods, which is a quotient of times: relative, and absolute.
    double quotient_rounding = 1e-14, count_rounding = 1e-9;
};

class Torques {
public:
    using Parameters = TorqueScheduleParameters;
    static constexpr Parameters parameters{};

    Torques(System& system, Progress& progress, const Options& options, Output& output, Breaks& breaks);

    // Pass the breaks of time functions up to a time. Time stepping computes velocity jumps itself.
    void enter(double time) { if (breaks_.next() <= time) breaks_.enter(time); }
    // Sample the sampled control if the next period of this control begins at the time of the run.
    void sample();
    // Call the user's callback, and set the torques that it returns. Return false if the callback ends the run.
    bool call_callback();
    // Replace the actuation torques from now on.
    void set(const VecX& torque);
    // Return the next time after the given one at which the actuation jumps or kinks or a time function breaks. The returned
    // time is at most `t_end`.
    double next_stop(double after, double t_end) const;

private:
    void recompute_rate();

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& progress_;
    const Options& options_;
    Output& output_;
    Breaks& breaks_;
};

// Return the number of whole lengths in a time, with a tolerance for multiples that rounding makes shorter.
double whole_lengths(double time, double length);

}  // namespace pn
