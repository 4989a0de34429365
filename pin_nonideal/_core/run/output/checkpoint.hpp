// Checkpoint of a run between two steps, as bytes. The resumed run is bitwise identical to a run that never stopped.
#pragma once

#include <cmath>
#include <string>

#include "run/events/gap_search.hpp"
#include "run/integrators/step_control.hpp"
#include "run/output/recorder.hpp"

namespace pn {

// State of a time loop from step to step, in addition to the RunState of its workspace.
struct Progress {
    double t = 0.0, h = 0.0;  // current time, and step that the error control suggests
    StepTrials trials;        // earlier trials of the step
    VecX y, rate;             // current state, and its rate
    // Time and state of the workspace's last configuration: the current state, or a sample inside the last step.
    double configured_t = 0.0;
    VecX configured_y;
    double numerical_energy = 0.0;  // total energy change due to projections and to the scheme of time stepping [J]
    long samples = 0;           // number of samples on the output grid
    long next_period = 0;       // index of the next period of sampled control
    double detected_break = HUGE_VAL;  // time of a break that was detected in a user's time function
    double last_break = -HUGE_VAL, next_break = HUGE_VAL;  // breaks around the stretch in which rows are evaluated
    std::vector<double> recent_event_times;  // times of recent events, for the detection of chatter
    std::vector<double> mode_change_times;  // times of the last instants at which modes changed
    std::vector<double> event_signs;  // signs of the values of value events
    int counted_steps = 0;      // accepted steps since `counted_from`, for the detection of stalled steps
    double counted_from = -HUGE_VAL;  // time [s]
    double bridged_time = 0.0, bridged_end = 0.0;  // length and end of the last bridged stretch [s]
    std::vector<double> slip_at_start;  // slip speed at the step's start, per element
    std::vector<char> in_tension;  // true for each bilateral contact in tension
    GapState gaps;                      // gaps at the step's start
    double forced_switch_time = -HUGE_VAL;  // time of the last forced mode switch
    double impact_energy = 0.0;         // total work of impacts [J]
    bool several_motions = false;  // several motions are possible, which was recorded
    long stiff_steps = 0, quiet_steps = 0;  // steps near the stability limit, later steps away from it
    VecX rounding;          // last measured rounding error of the rates, scaled to the tolerances that it requires
    long next_rounding_check = 0;     // step number of the next measurement of rounding
    // Decades of the largest speed: time, value and number of steps when it was reached.
    std::vector<double> growth_times, growth_speeds;
    std::vector<long> growth_steps;
    // Time stepping: the last step left the state unchanged; accelerations and forces belong to its end.
    bool is_stationary = false, has_forces = false;
    int turning_steps = 0;  // consecutive stiff steps with turning slip, negative: not counted yet
    bool may_hand_over = false;  // a closed contact may pass to the next feature in the next step
    double hand_over_time = -HUGE_VAL;  // time of the last hand-over
    double drive_end = -HUGE_VAL, drive_length = 0.0;  // end and length [s] of the last time step with a drive
    double rest_time = -HUGE_VAL;  // last time at which creeping slip came to rest
    bool misses_laws = false;      // the last time step violated the laws of contact
};

std::string to_bytes(Workspace& w, Progress& progress, Recording& out);
// Restore a new workspace. The data of an evaluation that the next step needs is recomputed from the state. Throw
// std::invalid_argument if the bytes do not fit the scene.
void from_bytes(const std::string& bytes, System& system, Progress& progress, Recording& out);

// Return a string that changes with the members of the stored types.
std::string state_layout();

}  // namespace pn
