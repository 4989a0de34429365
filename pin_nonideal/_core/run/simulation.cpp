#include "run/simulation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "run/events.hpp"

namespace pn {

namespace {

// At rest only the functions of the user tell when it ends. They are evaluated in steps of this length at most [s], or
// of this part of the rest so far.
constexpr double rest_step = 0.1, rest_part_step = 0.002;
// A step that falls short of the stop by less than this part goes there; one that takes more than this part of the way
// is made one of two even steps instead of a long and a tiny one.
constexpr double whole_way = 1.0 - 1e-10, even_part = 0.5;

// A step of fewer spacings of floating-point times than these leads nowhere.
constexpr double least_spacings = 4.0;
// Steps below this part of the time are short enough to tell what fails of its own.
constexpr double tiny_step = 1e-10;

// A run that has come less than this part of its way after so many steps never ends.
constexpr long early_steps = 20000;
constexpr double least_progress = 1e-10;

// Progress is told after so many steps.
constexpr long steps_a_tick = 16;
// Room for samples is taken at once up to this number; longer runs may stop before they fill it.
constexpr double most_reserved = 1e5;

// Chatter: this many events within its time make the run go on by time stepping for a while, in so many steps.
constexpr int chatter_events = 60;
constexpr int chatter_steps = 50;

// Part of a step to which the instant is found from which on several motions are possible.
constexpr double several_width = 1e-12;
// Of the step: where directions of slip relax faster, stability holds the explicit methods short (at 3 to 6); it is
// believed after some steps in a row, and asked again some steps after it turned out otherwise.
constexpr double stiff = 2.5;
constexpr int stiff_in_a_row = 6, patience = 20;
// Where directions are not found in a step of this length [s], the method asked for has to find a way.
constexpr double shortest_sought = 1e-9;

// Part of a step of time stepping that is not worth one of its own.
constexpr double least_part = 1e-9;
// Times closer than this part of them, or this many seconds, are the same.
constexpr double time_rounding = 1e-12;
double same_time(double t) { return time_rounding * std::max(1.0, std::abs(t)); }
// Number of whole lengths in a time that should be a multiple of them; their quotient may miss it by so much of itself
// and of one.
constexpr double quotient_rounding = 1e-14, count_rounding = 1e-9;
double whole_lengths(double time, double length) {
    return std::floor(time / length * (1.0 + quotient_rounding) + count_rounding);
}

}  // namespace

Simulation::Simulation(const Program& program, Workspace& workspace, const Options& run_options, Recording& recording)
    : p(program), w(workspace), options(run_options), out(recording), t_end(options.t0 + options.duration),
      system(program, workspace, options.record.energy), norm(system, options.rtol, options.atol),
      stepper(options.method, system, norm), control(options.method, options.rtol),
      stiffness(system, stepper, *this, t_end, run_options.max_steps),
      locator(system, stepper, slip_at_start, pulls), moreau(system),
      recorder(system, options.record, recording), sample_(VecX::Zero(system.ny)) {
    y = rate = configured_y = sample_;
    w.continues = options.continues;
    slip_at_start.assign(p.frictions.size(), 0.0);
    pulls.assign(p.contacts.size(), 0);
}

void Simulation::start(const VecX& q0, const VecX& v0) {
    t = options.t0;
    y.setZero();
    y.head(system.nq) = q0;
    y.segment(system.nq, system.nv) = v0;
    if (system.nz > 0) y.segment(system.nq + system.nv, system.nz) = w.state.z;
    samples = 1;
    // The steps of adaptive methods are not known before.
    const double apart = options.output_dt > 0.0 ? options.output_dt : options.dt;
    if (apart > 0.0) recorder.reserve(static_cast<size_t>(std::min(options.duration / apart + 2.0, most_reserved)));
    w.state.has_held = false;
    w.state.warm = false;
    sample_control();
    switch_modes(system, t, y, rate, std::nullopt);
    emit(t, y, true);
    report_pulls(std::nullopt);
    report_several(false);
    h = options.dt;
    if (options.method.adaptive()) {
        h = norm.initial_step(options.method.order, t, y, rate, t_end - t);
        system.read(y);
        begin_step(p, w, t, system.q, system.v);
    }
    configured_now();
}

void Simulation::run() {
    const bool in_time = options.method.scheme == Method::Scheme::moreau;
    while (t < t_end) {
        between_steps();
        if (in_time) {
            step_in_time(t_end, options.dt);
            continue;
        }
        Proposal proposal = propose();
        while (!control_error(proposal, integrate(proposal))) proposal = propose();
        stiffness.look();
        const std::optional<FoundEvent> event = locate_event();
        accept(proposal, event);
        record(event);
    }
    if (options.save) save();
}

// The only place where a run is interrupted or saved: what is left here is all that the next step needs.
void Simulation::between_steps() {
    try {
        if (options.tick && ++ticks % steps_a_tick == 0) options.tick(t);
    } catch (...) {
        if (options.save) save();
        throw;
    }
    if (options.save && Clock::now() >= next_save) save();
    if (out.steps == early_steps && t - options.t0 < least_progress * options.duration)
        throw Failure(Failure::Kind::step_size, t, {}, static_cast<double>(out.steps));
    if (options.max_steps > 0 && out.steps >= options.max_steps)
        throw Failure(Failure::Kind::steps, t, {}, static_cast<double>(out.steps));
}

void Simulation::save() {
    options.save(to_bytes(w, *this, out));
    next_save = Clock::now() + options.save_interval;
}

void Simulation::restore(const std::string& state) { from_bytes(state, system, *this, out); }

// --- Propose --------------------------------------------------------------------------------------------------------

void Simulation::sample_control() {
    const auto* sampled = std::get_if<SampledTorque>(&p.actuation);
    if (!sampled || w.now.has_override) return;
    if (w.state.has_held && t < options.t0 + next_period * sampled->period) return;
    system.read(y);
    sampled->function(t, system.q, system.v, w.state.held_torque);
    w.state.has_held = true;
    next_period = static_cast<long>(whole_lengths(t - options.t0, sampled->period)) + 1;
    // The torque jumps here: the derivative is taken anew.
    begin_step(p, w, t, system.q, system.v);
    system.rate_of_evaluation(t, y, rate);
    configured_now();
}

// Where actuation jumps or bends next.
double Simulation::next_stop() const {
    double stop = t_end;
    if (const auto* sampled = std::get_if<SampledTorque>(&p.actuation))
        stop = std::min(stop, options.t0 + next_period * sampled->period);
    if (const auto* table = std::get_if<TorqueTable>(&p.actuation)) {
        const auto next = std::upper_bound(table->times.begin(), table->times.end(), t);
        if (next != table->times.end()) stop = std::min(stop, *next);
    }
    return stop;
}

Simulation::Proposal Simulation::propose() {
    sample_control();
    const bool adaptive = options.method.adaptive();
    double stop = next_stop();
    if (!adaptive)  // the fixed grid, whatever events cut out of it
        stop = std::min(stop, options.t0 + (whole_lengths(t - options.t0, options.dt) + 1.0) * options.dt);
    const double remaining = stop - t;
    double size = adaptive ? h : remaining;
    if (adaptive && p.asks_functions && (system.velocity(y).array() == 0.0).all()) {
        const double since = out.events.empty() ? options.t0 : out.events.back().time;
        size = std::min(size, std::max(rest_step, rest_part_step * (t - since)));
    }
    bool last = false;
    if (size >= remaining * whole_way) {
        size = remaining;
        last = true;
    } else if (size > even_part * remaining) {
        size = even_part * remaining;
    }
    if (!adaptive && !p.frictions.empty()) {
        const double shorter = locator.shorten_toward_rest(rate, size);
        last &= shorter == size;
        size = shorter;
    }
    return {size, stop, last};
}

// --- Integrate ------------------------------------------------------------------------------------------------------

std::optional<double> Simulation::integrate(const Proposal& proposal) {
    stepper.y0 = y;
    stepper.y0.tail(2 * system.ne).setZero();  // what elements watch is theirs over one step
    stepper.start_rate() = rate;
    try {
        return try_step(proposal.size);
    } catch (const Failure& failure) {
        // A stage may leave the domain where the step is too long; a shorter one decides whether it is the motion.
        // Where the motion runs away no step is short enough, and that is what is wrong.
        const double tiny = tiny_step * std::max(1.0, std::abs(t));
        const bool runs_away = tiny * system.velocity(rate).norm() > system.velocity(y).norm();
        if (!options.method.adaptive() || (proposal.size < tiny && !runs_away) ||
            failure.kind == Failure::Kind::interrupted)
            throw;
        if (failure.kind == Failure::Kind::closure) opened = failure;
        return failed_error;
    }
}

// One step; where its error is allowed its end is projected and evaluated.
std::optional<double> Simulation::try_step(double size) {
    const double start_pivot = w.now.rows.distance;
    system.on_constraints = start_pivot < near_singular && !w.now.rows.blocks.empty();
    system.smallest_pivot = 1.0;
    stepper.take(t, size);
    if (system.smallest_pivot < near_singular && !system.on_constraints) {
        system.on_constraints = true;
        stepper.take(t, size);
    }
    if (!stepper.y1.allFinite()) throw Failure(Failure::Kind::not_finite, t + size);
    if (control.needs_detour(system.smallest_pivot, start_pivot, w.now.rows.distance)) return std::nullopt;
    const bool needs_end = options.method.first_same_as_last && !stepper.collocates();
    double error = needs_end ? 0.0 : stepper.error();
    if (!(error <= 1.0)) {
        w.state.seeks_directions &= !stepper.collocates() || size > shortest_sought;
        return error;
    }
    system.project_and_evaluate(t + size, stepper.y1, stepper.end_rate());
    stepper.learn();
    if (needs_end) error = stepper.error();
    turns_stiffly = options.method.adaptive() && turning(system) && stepper.stiffness() > stiff;
    return error;
}

// --- Control the error ----------------------------------------------------------------------------------------------

bool Simulation::control_error(const Proposal& proposal, std::optional<double> error) {
    const bool accepted = control.accepts(error, proposal.size, proposal.last, h);
    if (accepted) opened.reset();
    else ++out.rejected;
    if (accepted || !error || h >= least_spacings * std::abs(std::nextafter(t, t_end) - t)) return accepted;
    if (opened) throw *opened;
    throw Failure(Failure::Kind::step_size, t);
}

// --- Accept ---------------------------------------------------------------------------------------------------------

void Simulation::accept(const Proposal& proposal, const std::optional<FoundEvent>& event) {
    ++out.steps;
    t = event ? event->time : proposal.last ? proposal.stop : stepper.t0 + stepper.h;
    moved_energy += system.moved_energy;
    remember_directions(system, slip_at_start);
    y = stepper.y1;
    rate = stepper.end_rate();
    configured_now();
    if (!event || !event->changes_modes()) report_pulls(event);
    emit_inside_step(report_several(true));
    stepper.end_directions();
    choose_stepper();
    if (!event) return;
    if (event->changes_modes()) change_modes(*event);
    report_several(false);
    if (event->kind != FoundEvent::Kind::reversal) return;
    recent_events.push_back(t);
    bridge_cluster(event->index);
}

// By collocation as long as directions relax fast beside the next step; by the method asked for until its stability has
// held the steps short several times in a row.
void Simulation::choose_stepper() {
    stepper.forget();
    bool& seeks = w.state.seeks_directions;
    const double next = options.method.adaptive() ? h : options.dt;
    if (stepper.collocates()) {
        seeks = turning(system) && (stepper.h == 0.0 || stepper.stiffness() * next > stiff * stepper.h);
        turning_steps = seeks ? 0 : -patience;
    } else if (turning_steps < 0) {
        ++turning_steps;
    } else {
        turning_steps = turns_stiffly ? turning_steps + 1 : 0;
        seeks |= turning_steps == stiff_in_a_row;
    }
}

void Simulation::change_modes(const FoundEvent& event) {
    const Modes before = w.state.mode;
    for (const Event& change : switch_modes(system, t, y, rate, event)) {
        out.events.push_back(change);
        recent_events.push_back(t);
    }
    if (std::equal(before.begin(), before.end(), w.state.mode.begin())) recent_events.push_back(t);
    configured_now();
    bridge_cluster(event.index);
}

// Events that come too thick are bridged by time stepping, which needs none.
void Simulation::bridge_cluster(int element) {
    if (recent_events.size() > chatter_events) recent_events.erase(recent_events.begin());
    if (recent_events.size() < chatter_events || t - recent_events.front() > chatter_time) return;
    recent_events.clear();
    if (!options.method.outside()) stiffness.require_time_steps(chatter_time / chatter_steps);
    out.events.push_back({t, Event::Kind::chatter, element});
    if (options.method.outside()) return;  // whose steps go on without a look at events
    const double stop = std::min(t_end, t + chatter_time);
    w.state.seeks_directions = false;
    while (t < stop) step_in_time(stop, chatter_time / chatter_steps);
    switch_modes(system, t, y, rate, std::nullopt);
    configured_now();
}

// --- Record ---------------------------------------------------------------------------------------------------------

void Simulation::record(const std::optional<FoundEvent>& event) {
    if (event && event->changes_modes()) {
        emit(t, y, true);
        return;
    }
    const bool on_grid = options.output_dt > 0.0 && std::abs(next_sample() - t) <= same_time(t);
    if (options.output_dt != 0.0 && !on_grid && t < t_end) return;
    samples += on_grid;
    if (stepper.has_interpolant()) {
        system.read(y);
        evaluate(p, w, t, system.q, system.v);
        configured_now();
    }
    emit(t, y, true);
}

void Simulation::configured_now() {
    configured_t = t;
    configured_y = y;
}

void Simulation::emit(double at, const VecX& state, bool evaluated) {
    if (!out.t.empty() && at <= out.t.back()) return;
    recorder.sample(at, state, moved_energy, evaluated);
}

void Simulation::emit_between(double at) {
    stepper.make_interpolant();
    stepper.interpolate((at - stepper.t0) / stepper.h, sample_);
    if (!w.now.rows.blocks.empty()) {
        system.read(sample_);
        project(p, w, at, system.q, system.v);
        system.write(sample_);
    }
    if (!w.now.rows.blocks.empty() || options.record.evaluates() || p.constraints > 0) {
        configured_t = at;
        configured_y = sample_;
    }
    emit(at, sample_, false);
}

void Simulation::emit_inside_step(std::optional<double> between) {
    const double end = t - same_time(t);
    while (options.output_dt > 0.0 && next_sample() < end) {
        if (between && *between < next_sample()) {
            emit_between(*between);
            between.reset();
        }
        emit_between(next_sample());
        ++samples;
    }
    if (between && *between < end) emit_between(*between);
}

// A maintained contact that would have to pull, told once each time it begins.
void Simulation::report_pulls(const std::optional<FoundEvent>& event) {
    const bool found = event && event->kind == FoundEvent::Kind::pull;
    for (int i = 0; i < static_cast<int>(p.contacts.size()); ++i) {
        const bool pull = (found && i == event->index) || w.now.lam[p.blocks[p.contacts[i]].row] < 0.0;
        if (pull && !pulls[i]) out.events.push_back({t, Event::Kind::pull, p.contacts[i]});
        pulls[i] = pull;
    }
}

// Where the laws begin to allow other motions too, told once each time; returns when, where that lies inside the step.
std::optional<double> Simulation::report_several(bool after_step) {
    const bool before = several;
    several = w.state.unique == Uniqueness::several || w.now.several;
    if (before || !several) return std::nullopt;
    const int element = w.now.several_element;
    const double at = after_step && w.state.unique == Uniqueness::several ? last_unique() : t;
    out.events.push_back({at, Event::Kind::several, element});
    return at;
}

// Halves the step just taken, on its interpolant, toward the last instant at which its motion is the only one. The
// workspace is left as it was.
double Simulation::last_unique() {
    const RunState kept = w.state;
    stepper.make_interpolant();
    double low = 0.0, high = 1.0;
    while (high - low > several_width) {
        const double mid = 0.5 * (low + high);
        stepper.interpolate(mid, sample_);
        system.read(sample_);
        w.state.steps_since = never_decided;
        evaluate(p, w, stepper.t0 + mid * stepper.h, system.q, system.v);
        (w.state.unique == Uniqueness::several ? high : low) = mid;
    }
    w.state = kept;
    system.read(y);
    evaluate(p, w, t, system.q, system.v);
    return stepper.t0 + high * stepper.h;
}

// --- Time stepping --------------------------------------------------------------------------------------------------

void Simulation::step_in_time(double stop, double dt) {
    sample_control();
    double end = std::min({t + dt, stop, next_stop()});
    if (options.output_dt > 0.0) end = std::min(end, std::max(next_sample(), std::nextafter(t, stop)));
    if (stop - end < least_part * dt) end = stop;
    const Modes before = w.state.mode;
    moreau.step(t, end - t, y, moved_energy);
    ++out.steps;
    t = end;
    system.read(y);
    // Factors of the new modes: what sticks must not move as the rest is projected.
    begin_step(p, w, t, system.q, system.v);
    system.project_and_evaluate(t, y, rate);
    configured_now();
    remember_directions(system, slip_at_start);
    moved_energy += system.moved_energy;
    for (int e = 0; e < system.ne; ++e)
        if (before[e] != w.state.mode[e])
            out.events.push_back({t, kind_of_change(before[e], w.state.mode[e]), e});
    report_pulls(std::nullopt);
    report_several(false);
    const bool on_grid = options.output_dt > 0.0 && next_sample() <= t + same_time(t);
    samples += on_grid;
    if (options.output_dt == 0.0 || on_grid || t >= t_end) emit(t, y, true);
}

// --- Runs -----------------------------------------------------------------------------------------------------------

template <class Steps>
static void keep_what_stops(Recording& out, Steps steps) {
    try {
        steps();
    } catch (const Failure& failure) {
        out.failure = failure;
    } catch (...) {
        out.error = std::current_exception();
    }
}

void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    keep_what_stops(out, [&] {
        simulation.start(q0, v0);
        simulation.run();
    });
}

void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    simulation.restore(state);
    keep_what_stops(out, [&] { simulation.run(); });
}

}  // namespace pn
