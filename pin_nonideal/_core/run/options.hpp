// What is asked of a run.
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

// A function of the user whose zeros are events.
struct UserEvent {
    std::function<double(double t, const VecX& q, const VecX& v)> function;
    int direction = 0;  // +1: only where the value rises through zero; -1: falls; 0: either
    long terminal = 0;  // ends the run at so many of them; 0: never
};

struct Options {
    Method method;
    double t0 = 0.0, duration = 0.0;
    double rtol = 1e-8, dt = 0.0, output_dt = 0.0;  // output_dt 0: every accepted step
    VecX atol;                                      // 2 nv + states
    long max_steps = 0;                             // 0: as many as it takes, and fewer of a stiff scene
    RecordOptions record;
    double end() const { return t0 + duration; }
    bool strict = false;     // an impact that gains energy fails
    bool continues = false;  // where several motions are possible: with the one nearest to that before; else it fails
    double max_wall = 0.0;   // wall time that the run may take [s]; 0: as much as it takes
    std::vector<UserEvent> events;
    // Called between two steps: may end the run, or set the torques of the actuation from there on.
    enum class Told { go_on, stop, torque };
    std::function<Told(double t, const VecX& q, const VecX& v, VecX& torque)> callback;
    std::function<void(double t)> tick;  // progress and interruption, called now and then between steps
    // Once, where a run will take long because its steps follow a fast motion: time, dof whose force does most to that, its
    // rate [1/s], and whether it decays; else it swings.
    std::function<void(double t, int dof, double rate, bool decays)> hint;
    std::function<void(const std::string& state)> save;  // writes a checkpoint; empty: none
    Clock::duration save_interval{};                     // of wall time
};

// Times closer than this part of them, or this many seconds, are the same.
constexpr double time_rounding = 1e-12;
inline double same_time(double t) { return time_rounding * std::max(1.0, std::abs(t)); }

}  // namespace pn
