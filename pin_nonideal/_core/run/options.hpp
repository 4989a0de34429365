// Options of one run, as the caller sets them.
#pragma once

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <string>

#include "run/integrators/method.hpp"
#include "run/output/recorder.hpp"

namespace pn {

using Clock = std::chrono::steady_clock;

// User function whose zeros are events.
struct UserEvent {
    std::function<double(double t, const VecX& q, const VecX& v)> function;
    int direction = 0;  // +1: rising zeros only, -1: falling zeros only, 0: both
    long terminal = 0;  // number of events that ends the run, 0: never
};

struct Options {
    Method method;
    double t0 = 0.0, duration = 0.0;
    double rtol = 1e-8, dt = 0.0, output_dt = 0.0;  // output_dt 0: every accepted step
    VecX atol;                                      // 2 nv + states
    long max_steps = 0;                             // 0: no limit, except for stiff scenes
    RecordOptions record;
    double end() const { return t0 + duration; }
    bool strict = false;     // raise a Failure if an impact gains energy
    bool continues = false;  // if several motions are possible: take the nearest to the last one, else fail
    double max_wall = 0.0;   // maximum wall time [s], 0: no limit
    std::vector<UserEvent> events;
    // Called between two steps. Can end the run, or replace the actuation torques of later steps.
    enum class CallbackResult { proceed, stop, torque };
    std::function<CallbackResult(double t, const VecX& q, const VecX& v, VecX& torque)> callback;
    std::function<void(double t)> tick;  // progress and interruption, called every few steps
    // Called once if the run will be slow because its steps resolve a fast motion.
    // Arguments: time [s], dof whose force contributes most to the motion, rate of the motion [1/s], true if the motion
    // decays (false if it oscillates).
    std::function<void(double t, int dof, double rate, bool decays)> hint;
    std::function<void(const std::string& state)> save;  // writes a checkpoint, empty: none
    Clock::duration save_interval{};                     // wall time between two checkpoints
};

// Tolerance of equal times: relative to the time, in seconds below 1 s.
constexpr double time_rounding = 1e-12;
inline double same_time(double t) { return time_rounding * std::max(1.0, std::abs(t)); }

}  // namespace pn
