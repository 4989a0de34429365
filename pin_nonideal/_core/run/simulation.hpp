// The time loop: propose a step, integrate it, control the error, locate an event, accept, record.
#pragma once

#include <chrono>
#include <functional>
#include <optional>

#include "run/checkpoint.hpp"
#include "run/event_location.hpp"
#include "run/moreau.hpp"
#include "run/step_control.hpp"
#include "run/stiffness.hpp"

namespace pn {

using Clock = std::chrono::steady_clock;

struct Options {
    Method method;
    double t0 = 0.0, duration = 0.0;
    double rtol = 1e-8, dt = 0.0, output_dt = 0.0;  // output_dt 0: every accepted step
    VecX atol;                                      // 2 nv + states
    long max_steps = 0;                             // 0: as many as it takes, and fewer of a stiff scene
    RecordOptions record;
    bool continues = false;  // where several motions are possible: with the one nearest to that before; else it fails
    std::function<void(double t)> tick;  // progress and interruption, called now and then between steps
    std::function<void(const std::string& state)> save;  // writes a checkpoint; empty: none
    Clock::duration save_interval{};                     // of wall time
};

// Runs into `out`; failures end the run there and keep the samples.
void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out);
// Goes on in a new workspace from the state that `save` was given, with the same options; throws std::invalid_argument
// when the state does not fit.
void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out);

constexpr double chatter_time = 1e-4;  // for which events that come too thick are stepped over [s]

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
    // would pass too near a singular position; what the control of the error refuses is proposed again.
    Proposal propose();
    std::optional<double> integrate(const Proposal& proposal);
    bool control_error(const Proposal& proposal, std::optional<double> error);
    std::optional<FoundEvent> locate_event() { return locator.locate(); }
    void accept(const Proposal& proposal, const std::optional<FoundEvent>& event);
    void record(const std::optional<FoundEvent>& event);

    std::optional<double> try_step(double size);

    void between_steps();
    void save();
    void sample_control();
    double next_stop() const;
    double next_sample() const { return options.t0 + samples * options.output_dt; }

    void emit(double at, const VecX& state, bool evaluated);
    // A sample inside the step just taken, from its interpolant.
    void emit_between(double at);
    // Samples of the output grid inside the step just taken, and one at a time between.
    void emit_inside_step(std::optional<double> between);
    void report_pulls(const std::optional<FoundEvent>& event);
    std::optional<double> report_several(bool after_step);
    double last_unique();
    void configured_now();

    void choose_stepper();
    void change_modes(const FoundEvent& event);
    void bridge_cluster(int element);
    // One step of time stepping, not beyond `stop`.
    void step_in_time(double stop, double dt);

    const Program& p;
    Workspace& w;
    const Options& options;
    Recording& out;
    const double t_end;
    System system;
    ErrorNorm norm;
    Stepper stepper;
    StepControl control;
    StiffnessGuard stiffness;
    EventLocator locator;
    Moreau moreau;
    Recorder recorder;
    VecX sample_;
    bool turns_stiffly = false;  // the step just taken
    long ticks = 0;
    Clock::time_point next_save;
    std::optional<Failure> opened;  // a loop that a trial of this step could not close
};

}  // namespace pn
