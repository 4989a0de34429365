// The time loop: propose a step, integrate it, control the error, locate an event, accept, record.
#pragma once

#include <optional>
#include <string>

#include "run/events/event_location.hpp"
#include "run/integrators/growth.hpp"
#include "run/events/mode_switch.hpp"
#include "run/integrators/rounding_floor.hpp"
#include "run/integrators/step_control.hpp"
#include "run/integrators/stepper_choice.hpp"

namespace pn {

// Runs into `out`; failures end the run there and keep the samples.
void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out);
// Goes on in a new workspace from the state that `save` was given, with the same options; throws std::invalid_argument
// when the state does not fit.
void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out);

class Simulation : protected Progress {
public:
    Simulation(const Program& p, Workspace& w, const Options& options, Recording& out);
    void start(const VecX& q0, const VecX& v0);
    void restore(const std::string& state);
    // To the end, from the start or from a restored state.
    void run();

protected:
    struct Proposal {
        double size;
        double stop;  // the step must not go beyond
        bool last;    // it ends there
    };

    // The six verbs of a step. Integrating gives the norm of the error, 1 at the tolerance, or nothing where the step
    // would pass too near a singular position; what the control of the error refuses is proposed again, and so is a step
    // inside which an event cannot be located.
    Proposal propose();
    std::optional<double> integrate(const Proposal& proposal);
    bool control_error(const Proposal& proposal, std::optional<double> error);
    bool locate_event(const Proposal& proposal);
    void accept(const Proposal& proposal, const std::optional<FoundEvent>& event);
    void record(const std::optional<FoundEvent>& event);

    void pass_break();
    void find_event();
    bool goes_on(const Failure& failure);
    void back_to_start();

    std::optional<double> try_step(const Proposal& proposal);
    // Whether nothing asks for the acceleration at the end of this step.
    bool leaves_rate(const Proposal& proposal) const;

    bool done() const { return t >= t_end || value_events.ends_run(); }
    // Whether the run goes on.
    bool between_steps();
    void save();

    const Program& p;
    Workspace& w;
    const Options& options;
    Recording& out;
    double t_end;
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
    Output output;
    Notices notices;
    ValueEvents value_events;
    Breaks breaks;
    Torques torques;
    Landing landing;
    TimeStepping time_stepping;
    Clusters clusters;
    ModeChanges modes;
    VecX moved_;  // by the projection of the step's end
    long ticks = 0;
    Clock::time_point next_save;
    const Clock::time_point begun = Clock::now();
    std::optional<FoundEvent> event;  // in the step just taken
    RunState before_step;      // where anything was closed or rubbed
    bool watched = false;      // it did, as the step began
    bool stops_there = false;  // at t_end: nobody goes on from the state that is left
    std::optional<Failure> opened;  // a loop that a trial of this step could not close
};

}  // namespace pn
