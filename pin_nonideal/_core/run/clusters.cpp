#include "run/clusters.hpp"

#include <algorithm>

namespace pn {

namespace {

// This many events within the chatter's time make the run go on by time stepping for a while, in so many steps. Where
// it goes on right after, the while is made longer by this factor, up to the longest [s].
constexpr int chatter_events = 60;
constexpr int chatter_steps = 50;
constexpr double chatter_growth = 2.0, longest_chatter = 1e-2;

}  // namespace

Clusters::Clusters(System& system, Progress& progress, const Options& options, StiffnessGuard& stiffness,
                   TimeStepping& time_stepping, Recording& out)
    : w(system.w), now_(progress), options_(options), stiffness_(stiffness), time_stepping_(time_stepping),
      out_(out) {}

bool Clusters::bridge(int element, double t_end) {
    std::vector<double>& recent = now_.recent_events;
    if (recent.size() > chatter_events) recent.erase(recent.begin());
    if (recent.size() < chatter_events || now_.t - recent.front() > chatter_time) return false;
    const bool again = now_.bridged_time > 0.0 && recent.front() - now_.bridged_end < now_.bridged_time;
    recent.clear();
    now_.bridged_time = again ? std::min(chatter_growth * now_.bridged_time, longest_chatter) : chatter_time;
    const double dt = now_.bridged_time / chatter_steps;
    if (!options_.method.outside()) stiffness_.require_time_steps(dt);
    out_.events.push_back({now_.t, Event::Kind::chatter, element});
    if (options_.method.outside()) return false;  // whose steps go on without a look at events
    const double stop = std::min(t_end, now_.t + now_.bridged_time);
    w.state.seeks_directions = false;
    while (now_.t < stop) time_stepping_.step(dt, stop, t_end);
    now_.bridged_end = now_.t;
    return true;
}

}  // namespace pn
