// Events that change the modes of contacts and friction, and what is done where modes end without one.
#pragma once

#include "run/events/chatter.hpp"
#include "run/events/events.hpp"
#include "run/events/impact_handler.hpp"
#include "run/torque_schedule.hpp"

namespace pn {

// Steps below this part of the time are short enough to tell what fails of its own.
constexpr double tiny_step = 1e-10;
inline double tiny_step_at(double t) { return tiny_step * std::max(1.0, std::abs(t)); }

class ModeChanges {
public:
    ModeChanges(System& system, Progress& progress, const Options& options, Torques& torques, Output& output,
                Landing& landing, Clusters& clusters, Recording& out);

    // Modes and state from the event on, which has been reached.
    void change(FoundEvent event);
    // Where no step is short enough the motion may end that these modes have, unless those found when it did last lead no
    // further either. What comes next is asked as far beyond as the shortest step goes; false where nothing is found.
    bool may_end(const Failure& failure) const;
    bool leave();
    // Whether no motion or no step was found, which proves nothing.
    static bool leads_on(const Failure& failure);
    // What is left of events that dwindle, or of slip that creeps, to rest is stepped over where no motion of theirs was
    // found, or no step short enough, and so is what contacts that may open do where that was not found; whether it was.
    bool step_over(const Failure& failure);
    // Where events come too thick they are bridged, and the run goes on with modes of its new state.
    void bridge(int element);

private:
    void end_bouncing();
    void keep_last(const RunState& before, bool struck);
    bool undecided(const Failure& failure) const;
    bool creeps() const;
    void go_on_with_new_modes();

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& now_;
    const Options& options_;
    Torques& torques_;
    Output& output_;
    Landing& landing_;
    Clusters& clusters_;
    Recording& out_;
};

}  // namespace pn
