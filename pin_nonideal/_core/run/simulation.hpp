// The time loop: steps, projection, events, samples.
#pragma once

#include <chrono>
#include <functional>
#include <optional>

#include "dynamics/evaluation.hpp"
#include "dynamics/solution.hpp"
#include "dynamics/step_start.hpp"
#include "friction/modes.hpp"
#include "constraints/projection.hpp"
#include "run/recorder.hpp"

namespace pn {

using Clock = std::chrono::steady_clock;

class Archive;

struct Options {
    Method method;
    double t0 = 0.0, duration = 0.0;
    double rtol = 1e-8, dt = 0.0, output_dt = 0.0;  // output_dt 0: every accepted step
    VecX atol;                                      // 2 nv + states
    RecordOptions record;
    std::function<void(double t)> tick;  // progress and interruption, called now and then between steps
    std::function<void(const std::string& state)> save;  // writes a checkpoint; empty: none
    Clock::duration save_interval{};                     // of wall time
};

// Runs into `out`; failures end the run there and keep the samples.
void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out);
// Goes on from the state that `save` was given, with the same options; throws std::invalid_argument when the state does
// not fit.
void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out);

class Simulation {
public:
    Simulation(const Program& p, Workspace& w, const Options& options, Recording& out);
    void start(const VecX& q0, const VecX& v0);
    void restore(const std::string& state);
    // To the end, from the start or from a restored state.
    void run();

private:
    // Chatter: this many events within this time make the run go on by time stepping for a while.
    static constexpr int chatter_events = 60;
    static constexpr double chatter_time = 1e-4;
    static constexpr int chatter_steps = 50;

    void between_steps();
    void save();
    void archive(Archive& a);
    void sample_control(double t);
    double next_stop(double t) const;
    void advance_to(double stop);
    // Brings the step's end onto the constraints and evaluates there.
    void settle(double t, VecX& y, VecX& derivative);
    double energy_at(const VecX& y);
    void emit_between(double t_end);
    void emit(double t, const VecX& y, bool evaluated);

    // Events.
    static constexpr int no_trigger = -2;
    static constexpr double rest_part = 0.05, arrived_speed = 1e-7;
    double toward_rest(double size);
    struct Watch { int element; bool slip; int contact = -1; };  // a friction element, or a contact's pressure
    double speed_along(int element) const;
    double margin(const Watch& watch, double t, const VecX& y);  // negative past the event; evaluated state
    std::vector<Watch> crossed();
    double first_crossing(const Watch& watch);
    void step_onto(const Watch& found, double part);
    bool locate_event();
    bool release_indeterminate();
    void remember_directions();
    void switch_modes(double t, VecX& y, int trigger);
    void bridge_cluster(double t, VecX& y, int element);
    void report_pulls(double t);

    // Time stepping at velocity level.
    void moreau_step(double h);
    void step_in_time(double stop, double dt);  // one step, not beyond `stop`

    const Program& p;
    Workspace& w;
    const Options& o;
    Recording& out;
    System system;
    Stepper stepper;
    Recorder recorder;
    double t = 0.0, h = 0.0, t_end = 0.0;
    VecX y, derivative, q_, v_, probe_, probe_rate_;
    long samples = 0;  // of the output grid, so far
    long ticks = 0;
    Clock::time_point next_save;
    double next_sample = 0.0;
    std::vector<double> recent_events, slip_at_start;
    std::vector<char> pulls;
    bool last_rejected = false;
    int detours = 0;  // in a row, around a singular position
    std::optional<Failure> opened;  // a loop that a trial of this step could not close
    double pending_energy = 0.0;  // moved by the projection that ends the step
    int trigger_element = -1, located_element = -1, arrived = -1, parting = -1;
    bool released_together = false;  // redundant elements that could hold no longer
    long next_period = 0;
};

}  // namespace pn
