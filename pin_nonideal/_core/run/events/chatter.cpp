#include "run/events/chatter.hpp"

#include <algorithm>

namespace pn {

ChatterDetector::ChatterDetector(System& system, Progress& progress, const Options& options, StiffnessGuard& stiffness,
                   TimeStepping& time_stepping, Recording& out)
    : w(system.w), progress_(progress), options_(options), stiffness_(stiffness), time_stepping_(time_stepping),
      out_(out) {}

bool ChatterDetector::bridge_chatter(int element, double t_end) {
    std::vector<double>& recent = progress_.recent_event_times;
    if (recent.size() > parameters.events) recent.erase(recent.begin());
    if (recent.size() < parameters.events || progress_.t - recent.front() > parameters.window) return false;
    if (!options_.method.outside()) {
        stiffness_.require_time_steps(next_stretch() / parameters.steps);
        bridge_stretch(element, t_end);
        return true;
    }
    recent.clear();  // steps of SciPy's methods continue without event location
    out_.events.push_back({progress_.t, Event::Kind::chatter, element});
    return false;
}

void ChatterDetector::remember() {
    std::vector<double>& last = progress_.mode_change_times;
    if (!last.empty() && last.back() == progress_.t) return;
    if (last.size() == parameters.dwindling_events) last.erase(last.begin());
    last.push_back(progress_.t);
}

bool ChatterDetector::is_zeno() const {
    const std::vector<double>& last = progress_.mode_change_times;
    return last.size() == parameters.dwindling_events && progress_.t - last.front() <= parameters.window;
}

bool ChatterDetector::is_stalled() {
    if (++progress_.counted_steps < parameters.stalled_steps) return false;
    const bool stalls = progress_.t - progress_.counted_from <= parameters.stalled_time;
    progress_.counted_steps = 0;
    progress_.counted_from = progress_.t;
    return stalls;
}

// Return the length [s] of the next stretch: twice the last one if events accumulated again right after it.
double ChatterDetector::next_stretch() const {
    const std::vector<double>& recent = progress_.recent_event_times;
    const double first = recent.empty() ? progress_.t : recent.front();
    const bool again = progress_.bridged_time > 0.0 && first - progress_.bridged_end < progress_.bridged_time;
    return again ? std::min(parameters.growth * progress_.bridged_time, parameters.longest) : parameters.window;
}

void ChatterDetector::bridge_stretch(int element, double t_end) {
    progress_.bridged_time = next_stretch();
    progress_.recent_event_times.clear();
    progress_.mode_change_times.clear();
    const double dt = progress_.bridged_time / parameters.steps;
    out_.events.push_back({progress_.t, Event::Kind::chatter, element});
    const double stop = std::min(t_end, progress_.t + progress_.bridged_time);
    w.state.solves_directions = false;
    while (progress_.t < stop) time_stepping_.step(dt, stop, t_end);
    progress_.bridged_end = progress_.t;
    w.now.no_motion = false;  // concerns the last step only
}

}  // namespace pn
