// Mode switches of contacts and friction: at events, and forced switches if the current modes have no further motion.
#pragma once

#include "run/events/chatter.hpp"
#include "run/events/mode_selection.hpp"
#include "run/events/impact_handler.hpp"
#include "run/torque_schedule.hpp"

namespace pn {

struct ModeChangeParameters {
    // Minimum time between two forced mode switches, in tiny steps.
    double forced_switch_spacing = 1e3;
    // Maximum speed [m/s or rad/s] of slip that is about to rest or to begin, relative to 1 + the largest velocity.
    double max_creep_speed = 1e-8;
    // Length of a tiny step, relative to the time, in seconds below 1 s. Motions over shorter steps are lost in rounding.
    double tiny_step = 1e-10;
    // Length [s] of the first time step in which a prescribed motion starts, or its fraction of a fixed step. Further steps
    // are twice as long.
    double drive_step = 1e-7, drive_part = 1e-4;
    int max_drive_steps = 14;  // maximum number of these steps
};

inline constexpr ModeChangeParameters mode_change_parameters{};

inline double tiny_step_at(double t) { return mode_change_parameters.tiny_step * std::max(1.0, std::abs(t)); }

class ModeChanges {
public:
    ModeChanges(System& system, Progress& progress, const Options& options, Torques& torques, Output& output,
                ImpactHandler& impacts, TimeStepping& time_stepping, ChatterDetector& chatter, Recording& out);

    // Forget the mode switches of an earlier run.
    void start() { progress_.drive_end = progress_.rest_time = -HUGE_VAL; }
    // Switch modes and state at an event that has been reached.
    void change(FoundEvent event);
    // Forced switch: if no step is short enough, the motion of the current modes may have ended. `can_switch_modes`
    // returns false if the last forced switch was less than `forced_switch_spacing` tiny steps ago. `force_switch`
    // selects modes one tiny step ahead. The function returns false if no modes allow a motion.
    bool can_switch_modes(const Failure& failure) const;
    bool force_switch();
    // Check if the failure only means that no motion or no step was found, which proves nothing.
    static bool is_recoverable(const Failure& failure);
    // Check if a run that continues with one of several motions can continue by time stepping, which finds a motion.
    bool takes_any_motion(const Failure& failure) const;
    // Bridge by time stepping if no motion or no short enough step was found. Applies to an accumulation of events, to
    // creeping slip, to unilateral contacts without a solution, and beside a hand-over. Return false if it does not apply.
    bool bridge_with_time_stepping(const Failure& failure, bool of_hand_over = false);
    // Check if a step may have failed because closed contacts contradict each other or prevent the accuracy.
    static bool is_of_closed_contacts(const Failure& failure);
    // Check if rows of closed contacts alone contradict each other. Such rows are nearly dependent.
    bool is_of_contradicting_contacts(const Failure& failure) const;
    // Let sticking elements slip at the start of prescribed motions. Accelerations select the elements, or else speeds
    // after short time steps. `contradicts_drive` checks if sticking elements contradict these motions.
    bool contradicts_drive(const Failure& failure) const;
    bool follow_drive();
    // Bridge an accumulation of events, and select modes at the new state.
    void bridge_chatter(int element);
    // Bridge steps with closed contacts that no longer advance the time, and select modes at the new state.
    void bridge_stalled_steps();

private:
    void bridge(int element);
    void end_bouncing();
    bool was_released(int gap) const;
    void restore_last(const RunState& before, bool has_impact);
    static bool is_undecided(const Failure& failure);
    bool is_creeping() const;
    bool come_to_rest();
    void evaluate_again();
    void select_new_modes();
    bool step_with_drive(RunState& before);
    void restore_modes(const RunState& before);

    const Program& p;
    Workspace& w;
    System& system_;
    Progress& progress_;
    const Options& options_;
    Torques& torques_;
    Output& output_;
    ImpactHandler& impacts_;
    TimeStepping& time_stepping_;
    ChatterDetector& chatter_;
    Recording& out_;
};

}  // namespace pn
