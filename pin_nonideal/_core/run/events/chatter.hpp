// Events that come too thick (chatter) are bridged by time stepping, which needs none.
#pragma once

#include "run/integrators/stiffness.hpp"
#include "run/time_stepping/bridge.hpp"

namespace pn {

constexpr double chatter_time = 1e-4;  // for which events that come too thick are stepped over [s]

class Clusters {
public:
    Clusters(System& system, Progress& progress, const Options& options, StiffnessGuard& stiffness,
             TimeStepping& time_stepping, Recording& out);

    // An event that changes the motion, now.
    void count() { now_.recent_events.push_back(now_.t); }
    // An instant at which modes change.
    void remember();
    // Goes on by time stepping for a while where events come too thick, the last of this element; whether it did. The
    // modes are to be found anew then.
    bool bridge(int element, double t_end);
    // Whether this event, whose motion was not found, is one of several that came closer and closer: what is left of them
    // until they rest is less than a step can tell.
    bool dwindles() const;
    // Goes on by time stepping for a while.
    void step_over(int element, double t_end);

private:
    double next_stretch() const;

    Workspace& w;
    Progress& now_;
    const Options& options_;
    StiffnessGuard& stiffness_;
    TimeStepping& time_stepping_;
    Recording& out_;
};

}  // namespace pn
