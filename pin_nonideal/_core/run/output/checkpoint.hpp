// A run between two steps as bytes, from which it goes on bit by bit as if it had never stopped.
#pragma once

#include <cmath>
#include <string>

#include "run/events/gap_search.hpp"
#include "run/output/recorder.hpp"

namespace pn {

// What of a time loop survives from step to step, beside the RunState of its workspace.
struct Progress {
    double t = 0.0, h = 0.0;  // now, and the step that the error control suggests
    VecX y, rate;             // the state now, and its rate
    // Where the workspace was configured last: at the state now, or at a sample inside the last step.
    double configured_t = 0.0;
    VecX configured_y;
    double moved_energy = 0.0;  // by projection, so far
    long samples = 0;           // of the output grid, so far
    long next_period = 0;       // of sampled control
    double found_break = HUGE_VAL;  // of a function of time of the user's, inside the next steps
    std::vector<double> recent_events;  // times, for the count of those that come too thick
    std::vector<double> last_changes;   // times of the last instants at which modes changed
    std::vector<double> sides;          // of values that tell events by their signs
    double bridged_time = 0.0, bridged_end = 0.0;  // for which a cluster of them was stepped over last, and until when
    std::vector<double> slip_at_start;  // of the step, by element
    std::vector<char> pulls;            // by contact that is kept
    GapState gaps;                      // at the step's start
    double left = -HUGE_VAL;           // when modes were left last that went no further
    double impact_energy = 0.0;         // of all impacts so far
    bool several = false;               // the laws allow other motions too, which was told
    long stiff_steps = 0, quiet_steps = 0;  // near the border of stability, and since then away from it
    VecX rounding;          // of the rates as measured last, raised to what tolerances must allow
    long next_look = 0;     // at that: number of the step
    // The largest speed decade by decade: when it was reached, its value, and the number of steps by then.
    std::vector<double> growth_times, growth_speeds;
    std::vector<long> growth_steps;
    int turning_steps = 0;  // in a row that were stiff while slip turned; negative: not to be counted yet
};

std::string to_bytes(Workspace& w, Progress& progress, Recording& out);
// Into a new workspace: what the next step needs of an evaluation is made from the state. Throws std::invalid_argument
// when the bytes do not fit the scene.
void from_bytes(const std::string& bytes, System& system, Progress& progress, Recording& out);

// Changes with the members of what the bytes hold.
std::string state_layout();

}  // namespace pn
