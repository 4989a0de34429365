// Times at which time functions break. Steps end there, and the next step evaluates the functions after the break. If
// the rate of a prescribed motion jumps, an impulse of the motion's rows makes the velocity jump.
#pragma once

#include <optional>
#include <vector>

#include "math/time_function.hpp"
#include "run/output/output.hpp"

namespace pn {

struct BreaksParameters {
    // Maximum change of a continuous rate, relative to 1 + the largest velocity.
    double rate_rounding = 1e-11;
    // Thresholds that start the search for a jump. `unexplained`: change of the rate beyond the integral of the
    // accelerations, relative to the rate. `uneven`: change of the acceleration, relative to the acceleration.
    double unexplained = 1e-4, uneven = 0.2;
    // A jump keeps at least this fraction of the initial defect in one half of each bisected interval. A smooth function
    // keeps a smaller fraction.
    double kept_part = 0.3;
    // Maximum jump of a value [m or rad]. Larger jumps raise a Failure.
    double value_jump = 1e-9;
    // Number of intervals of an adaptive step in which a user function is checked. Adaptive steps can be long.
    int adaptive_intervals = 16;
};

class Breaks {
public:
    using Parameters = BreaksParameters;
    static constexpr Parameters parameters{};

    Breaks(System& system, Progress& progress, Output& output, Recording& out);

    // Set the stretch between the last break and the next one at the current time, or at another one. Rows are evaluated
    // within this stretch.
    void enter() { enter(progress_.t); }
    void enter(double time);
    // Time of the next break after the current time or after another one (infinity if none), and a check if it is
    // reached.
    double next() const { return progress_.next_break; }
    double next(double after) const;
    bool reached() const { return progress_.t >= next(); }
    // Pass the break that was reached, and recompute the rate. Return true if the velocity has jumped. The caller must
    // then select the modes of contacts and friction.
    bool pass();
    // Search for a break of a user function in a step from the current time to `end`. A pulse inside one interval of
    // the search is not detected (16 intervals for adaptive steps, else 1).
    void find_in_step(double end, bool adaptive = true);

private:
    struct Motion {
        int block;
        const TimeFunction* function;
    };

    std::vector<double> rates(double t) const;
    void jump(const std::vector<double>& before, const std::vector<double>& after);
    void append_event(const std::vector<double>& before, const std::vector<double>& after, const VecX& v_minus,
                      const VecX& impulse);

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& progress_;
    Output& output_;
    Recording& out_;
    std::vector<Motion> motions_;
};

}  // namespace pn
