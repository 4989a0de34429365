// Time loop: propose a step, integrate it, control the error, locate an event, accept, record.
#pragma once

#include <optional>
#include <string>

#include "run/events/event_location.hpp"
#include "run/integrators/growth.hpp"
#include "run/events/hand_over.hpp"
#include "run/events/mode_changes.hpp"
#include "run/integrators/rounding_floor.hpp"
#include "run/integrators/step_control.hpp"
#include "run/integrators/stepper_choice.hpp"
#include "run/run_limits.hpp"

namespace pn {

struct SimulationParameters {
    // Maximum step while the scene is at rest: absolute [s], and relative to the duration of the rest. Only user
    // functions can end the rest, so they are evaluated at least this often.
    double rest_step = 0.1, rest_part_step = 0.002;
    // Steps longer than `whole_way` times the remaining time end at the stop. Steps longer than `even_part` times the
    // remaining time are cut to that length. Two even steps then replace a long and a tiny one.
    double whole_way = 1.0 - 1e-10, even_part = 0.5;
    // Factor on the step size if event location fails.
    double shortened = 0.3;
    // Minimum step [s, or relative to the time] for which the projection of the step's end counts as an error.
    // Constraints that turn or open in a shorter step are detected in the next one.
    double shortest_measured = 1e-7;
    // Minimum step, in floating-point spacings of the time. Smaller steps raise a Failure.
    double min_step_spacings = 4.0;
    // Step after one that ended before a rest, relative to the time to the rest. The rest then lies inside the step.
    double past_rest = 1.02;
    // If collocation fails in steps shorter than this [s], the selected method takes the next trial.
    double shortest_sought = 1e-9;
};

// Time loop of one run. SteppedRun and ExternalRun advance the same loop from outside.
class Simulation {
public:
    using Parameters = SimulationParameters;
    static constexpr Parameters parameters{};

    Simulation(const Program& p, Workspace& w, const Options& options, Recording& out);
    void start(const VecX& q0, const VecX& v0);
    void restore(const std::string& state);
    // Integrate to the end, from the start or from a restored state.
    void run();
    // Report progress and check the wall time at evaluations too. A step may take many evaluations.
    void watch_evaluations() { run_limits.watch_evaluations(); }

protected:
    struct Proposal {
        double size = 0.0;
        double stop = 0.0;  // latest end time of the step
        bool last = false;  // the step ends at `stop`
    };

    // Six phases of a step. `integrate` returns the error norm, 1 at the tolerance. `integrate` returns nothing if the step
    // would pass too near a singular position. A step is proposed again if its error is rejected or if an event inside
    // cannot be located.
    Proposal propose();
    std::optional<double> integrate(const Proposal& proposal);
    bool control_error(const Proposal& proposal, std::optional<double> error);
    bool locate_event(const Proposal& proposal);
    void accept(const Proposal& proposal, const std::optional<FoundEvent>& event);
    void record(const std::optional<FoundEvent>& event);

    void pass_break();
    // Return the length of a step up to the next hand-over of a closed contact, after passing the hand-overs at this time.
    std::optional<double> pass_hand_overs();
    void find_event();
    bool satisfies_laws();
    bool recover(const Failure& failure);
    void restore_guess();
    void back_to_start();

    std::optional<double> try_step(const Proposal& proposal);
    // Check if the acceleration at the end of this step is not needed.
    bool leaves_rate(const Proposal& proposal) const;

    bool done() const { return progress.t >= t_end || value_events.ends_run(); }
    // Check the limits of the run and call the callback. Return false if the run must stop.
    bool between_steps();

    // Set-up of the run, the same in all steps.
    const Program& p;
    Workspace& w;
    const Options& options;
    Recording& out;
    double t_end;
    bool stops_there = false;  // no other period continues from the state at t_end

    Progress progress;  // state from step to step, with the current time, state and step size

    // Parts of the run. The parts read and change `progress`.
    RunLimits run_limits;
    System system;
    ErrorNorm norm;
    Stepper stepper;
    StepControl control;
    StepperChoice choice;
    StiffnessGuard stiffness;
    RoundingFloor floor;
    GrowthGuard growth;
    GapWatch watch;
    EventLocator locator;
    HandOver hand_over;
    Output output;
    Warnings warnings;
    ValueEvents value_events;
    Breaks breaks;
    Torques torques;
    ImpactHandler impacts;
    TimeStepping time_stepping;
    ChatterDetector chatter;
    ModeChanges modes;

    // Data of the current step only.
    VecX projection_move;  // displacement due to the projection of the step's end
    std::optional<FoundEvent> event;  // event in the step just taken
    RunState before_step;      // run state at the step's start, set if `watched`
    VecX guess;                // loads at the step's start, the initial guess of its first stage
    std::vector<Force> guessed_wrench;  // wrenches of these loads
    bool has_guessed_wrench = false;    // true if `guessed_wrench` belongs to the loads in `guess`
    bool has_guess = false;    // true if the loads at the step's start are known
    bool watched = false;      // a contact was closed or an element active at the step's start
    bool hand_over_ahead = false;  // the step ends before a hand-over
    std::optional<Failure> open_loop;  // loop that a trial of this step could not close
};

}  // namespace pn
