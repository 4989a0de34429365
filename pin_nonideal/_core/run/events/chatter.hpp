// Chatter: time stepping, which locates no events, bridges accumulations of events and of short steps.
#pragma once

#include "run/integrators/stiffness.hpp"
#include "run/time_stepping/time_stepping.hpp"

namespace pn {

struct ChatterParameters {
    // Number of events within `window` that starts a stretch of time stepping.
    int events = 60;
    // Number of instants with mode changes within `window` that counts as an accumulation (Zeno) if the last one
    // finds no motion.
    size_t dwindling_events = 6;
    int stalled_steps = 2000;     // successive steps that stall if they take at most `stalled_time` together
    double stalled_time = 1e-6;   // time that this number of steps advances, or less [s]
    int steps = 50;  // steps of a stretch
    // Growth of the stretch if events accumulate again right after it, and longest stretch [s].
    double growth = 2.0, longest = 1e-2;
    double window = 1e-4;  // window of the event count, and shortest stretch of time stepping [s]
};

class ChatterDetector {
public:
    using Parameters = ChatterParameters;
    static constexpr Parameters parameters{};

    ChatterDetector(System& system, Progress& progress, const Options& options, StiffnessGuard& stiffness,
             TimeStepping& time_stepping, Recording& out);

    // Count an event at the current time that changes the motion.
    void count() { progress_.recent_event_times.push_back(progress_.t); }
    // Record the current time as an instant of mode changes.
    void remember();
    // Bridge a stretch by time stepping if events accumulate. `element`: friction element of the last event. Return
    // true if a stretch was bridged. The caller must then select the modes.
    bool bridge_chatter(int element, double t_end);
    // Check if an event without a known motion ends an accumulation of mode changes. A step cannot resolve the
    // remaining time until rest.
    bool is_zeno() const;
    // Count an accepted step. Return true if many steps have advanced the time by almost nothing.
    bool is_stalled();
    // Bridge one stretch by time stepping.
    void bridge_stretch(int element, double t_end);

private:
    double next_stretch() const;

    Workspace& w;
    Progress& progress_;
    const Options& options_;
    StiffnessGuard& stiffness_;
    TimeStepping& time_stepping_;
    Recording& out_;
};

}  // namespace pn
