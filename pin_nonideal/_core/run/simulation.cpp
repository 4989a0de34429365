#include "run/simulation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "run/events/events.hpp"

namespace pn {

namespace {

// At rest only the functions of the user tell when it ends. They are evaluated in steps of this length at most [s], or
// of this part of the rest so far.
constexpr double rest_step = 0.1, rest_part_step = 0.002;
// A step that falls short of the stop by less than this part goes there; one that takes more than this part of the way
// is made one of two even steps instead of a long and a tiny one.
constexpr double whole_way = 1.0 - 1e-10, even_part = 0.5;

// Part of a step that is tried next where the event inside it is not found.
constexpr double shortened = 0.3;
// Steps shorter than this [s, and of the time] go on where their constraints turn or open, which the next one shows.
constexpr double shortest_measured = 1e-7;
// A step of fewer spacings of floating-point times than these leads nowhere.
constexpr double least_spacings = 4.0;
// A run that has come less than this part of its way after so many steps never ends.
constexpr long early_steps = 20000;
constexpr double least_progress = 1e-10;

// Progress is told after so many steps.
constexpr long steps_a_tick = 16;

// The step after one that ended before a rest takes this part of the time to it, so that the rest lies inside.
constexpr double past_rest = 1.02;

// Where directions are not found in a step of this length [s], the method asked for has to find a way.
constexpr double shortest_sought = 1e-9;

}  // namespace

Simulation::Simulation(const Program& program, Workspace& workspace, const Options& run_options, Recording& recording)
    : p(program), w(workspace), options(run_options), out(recording), t_end(options.end()),
      system(program, workspace, options.record.energy), norm(system, options.rtol, options.atol, rounding),
      stepper(options.method, system, norm), control(options.method, options.rtol),
      choice(system, stepper, *this, run_options), stiffness(system, stepper, *this, run_options),
      floor(system, stepper, norm, *this, recording), growth(system, *this, run_options, recording),
      watch(system, gaps), locator(system, stepper, norm, slip_at_start, pulls, watch),
      output(system, stepper, *this, run_options, recording), notices(system, stepper, *this, recording),
      value_events(run_options.events, system, stepper, *this), breaks(system, *this, output, recording),
      torques(system, *this, run_options, output, breaks),
      landing(system, *this, watch, run_options, output, recording),
      time_stepping(system, *this, watch, run_options, torques, output, notices, value_events, recording),
      clusters(system, *this, run_options, stiffness, time_stepping, recording),
      modes(system, *this, run_options, torques, output, landing, clusters, recording) {
    y = rate = configured_y = VecX::Zero(system.ny);
    // Time stepping finds its motion in velocities; of accelerations, which are recorded only, the nearest do.
    const bool in_time = options.method.scheme == Method::Scheme::moreau;
    w.continues = options.continues || (in_time && system.ng > 0);
    slip_at_start.assign(p.frictions.size(), 0.0);
    pulls.assign(p.contacts.size(), 0);
}

void Simulation::start(const VecX& q0, const VecX& v0) {
    t = options.t0;
    y.setZero();
    y.head(system.nq) = q0;
    y.segment(system.nq, system.nv) = v0;
    if (system.nz > 0) y.segment(system.nq + system.nv, system.nz) = w.state.z;
    output.begin();
    breaks.enter();
    w.state.has_held = false;
    w.state.warm = false;
    torques.sample();
    if (system.ng > 0) {
        set_closed(p, w, std::vector<char>(p.gaps.size(), 0));
        landing.strike(true);
    }
    switch_modes(system, t, y, rate, std::nullopt);
    landing.remember_gaps();
    output.now();
    notices.pulls(std::nullopt);
    notices.several(false);
    value_events.start(t, y);
    h = options.dt;
    if (options.method.adaptive()) {
        h = norm.initial_step(options.method.order, t, y, rate, t_end - t);
        system.read(y);
        begin_step(p, w, t, system.q, system.v);
    }
    output.configured_now();
}

void Simulation::run() {
    const bool in_time = options.method.scheme == Method::Scheme::moreau;
    time_stepping.forget();
    while (!done() && between_steps()) {
        if (in_time) {
            time_stepping.step(options.dt, t_end, t_end);
            continue;
        }
        Proposal proposal = propose();
        try {
            while (!control_error(proposal, integrate(proposal)) || !locate_event(proposal)) proposal = propose();
        } catch (const Failure& failure) {
            if (!goes_on(failure)) throw;
            continue;
        }
        accept(proposal, event);
        record(event);
    }
    if (t < t_end) {  // ended by the user, with a last sample here
        system.read(y);
        if (!w.now.no_motion) evaluate(p, w, t, system.q, system.v);
        output.now();
    }
    if (options.save) save();
}

// The only place where a run is interrupted or saved: what is left here is all that the next step needs.
bool Simulation::between_steps() {
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
    if (options.max_wall > 0.0 && std::chrono::duration<double>(Clock::now() - begun).count() > options.max_wall)
        throw Failure(Failure::Kind::wall, t, {}, options.max_wall);
    return !options.callback || torques.ask_callback();
}

void Simulation::save() {
    options.save(to_bytes(w, *this, out));
    next_save = Clock::now() + options.save_interval;
}

void Simulation::restore(const std::string& state) {
    from_bytes(state, system, *this, out);
    breaks.enter();
}

// --- Propose --------------------------------------------------------------------------------------------------------

Simulation::Proposal Simulation::propose() {
    if (breaks.reached()) pass_break();
    torques.sample();
    const bool adaptive = options.method.adaptive();
    if (p.searches_breaks) breaks.look(std::min(t_end, t + (adaptive ? h : options.dt)), adaptive);
    double stop = torques.next_stop(t_end);
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

void Simulation::pass_break() {
    if (!breaks.pass()) return;
    if (system.has_events()) modes.change({FoundEvent::Kind::touch, -1, t});
    output.now();
}

// --- Integrate ------------------------------------------------------------------------------------------------------

std::optional<double> Simulation::integrate(const Proposal& proposal) {
    opened.reset();  // of this step alone: a shorter one may fail for another reason
    watched = system.watches();
    if (watched) before_step = w.state;
    const int active = system.active();
    stepper.y0.head(system.ns) = y.head(system.ns);
    stepper.y0.segment(system.ns, active - system.ns).setZero();  // what elements watch is theirs over one step
    stepper.start_rate().head(active) = rate.head(active);
    try {
        return try_step(proposal);
    } catch (const Failure& failure) {
        // A stage may leave the domain where the step is too long; a shorter one decides whether it is the motion.
        // Where the motion runs away no step is short enough, and that is what is wrong.
        const double tiny = tiny_step_at(t);
        const bool runs_away = tiny * system.velocity(rate).norm() > system.velocity(y).norm();
        if (!options.method.adaptive() || (proposal.size < tiny && !runs_away) ||
            failure.kind == Failure::Kind::interrupted)
            throw;
        if (failure.kind == Failure::Kind::closure) opened = failure;
        return failed_error;
    }
}

// One step; where its error is allowed its end is projected and evaluated.
std::optional<double> Simulation::try_step(const Proposal& proposal) {
    const double size = proposal.size;
    const double start_pivot = w.now.rows.distance;
    system.on_constraints = start_pivot < near_singular && !w.now.rows.blocks.empty();
    system.smallest_pivot = 1.0;
    stepper.take(t, size);
    if (system.smallest_pivot < near_singular && !system.on_constraints) {
        system.on_constraints = true;
        stepper.take(t, size);
    }
    if (!stepper.y1.head(stepper.active).allFinite()) throw Failure(Failure::Kind::not_finite, t + size);
    if (control.needs_detour(system.smallest_pivot, start_pivot, w.now.rows.distance)) return std::nullopt;
    const bool needs_end = options.method.first_same_as_last && !stepper.collocates();
    double error = needs_end ? 0.0 : stepper.error();
    if (!(error <= 1.0)) {
        w.state.seeks_directions &= !stepper.collocates() || size > shortest_sought;
        return error;
    }
    const bool measures = p.driven_exactly && options.method.adaptive() &&
                          size > shortest_measured * std::max(1.0, std::abs(t));
    if (measures) {
        moved_ = stepper.y1;
        w.now.projected_gap = w.now.projected_rate = 0.0;
    }
    if (!leaves_rate(proposal) || !system.is_on_constraints(t + size, stepper.y1))
        system.project_and_evaluate(t + size, stepper.y1, stepper.end_rate());
    stepper.learn();
    if (needs_end) error = stepper.error();
    if (measures) {
        // Where the constraints drive the motion the stages do not see this error: the projection takes it back.
        moved_ -= stepper.y1;
        error = std::max(error, norm.of_projection(moved_, stepper.y0, stepper.y1, t, size));
    }
    choice.look();
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

// --- Locate events --------------------------------------------------------------------------------------------------

void Simulation::find_event() {
    event.reset();
    if (system.has_events())
        if (const auto found = locator.locate()) event = *found;
    if (!value_events.empty() && value_events.locate(event.has_value()))
        event = FoundEvent{FoundEvent::Kind::user, value_events.found().front(), stepper.t0 + stepper.h};
}

bool Simulation::locate_event(const Proposal& proposal) {
    stiffness.look();
    floor.look();
    try {
        find_event();
        return true;
    } catch (const Failure& failure) {
        // The step taken again up to an event went where the whole one did not: it is too long.
        const double tiny = tiny_step_at(t);
        if (!options.method.adaptive() || proposal.size < tiny || failure.kind == Failure::Kind::interrupted) throw;
    }
    ++out.rejected;
    h = shortened * proposal.size;
    back_to_start();
    return false;
}

// A method with an error takes it from there; events, functions, and what is recorded beside the state ask for it.
bool Simulation::leaves_rate(const Proposal& proposal) const {
    return stops_there && proposal.last && proposal.stop >= t_end && !options.method.adaptive() &&
           !system.has_events() && system.nz == 0 && !p.asks_functions && value_events.empty() &&
           !options.record.evaluates() && !options.record.dense && !options.callback && !options.save;
}

// Where no step is short enough other modes may lead on from where it began, or time stepping.
bool Simulation::goes_on(const Failure& failure) {
    const bool may_end = modes.may_end(failure), leads_on = ModeChanges::leads_on(failure);
    if (!may_end && !leads_on) return false;
    try {
        back_to_start();
        if (may_end && modes.leave()) return true;
    } catch (const Failure& at_start) {  // the motion of these modes does not even begin
        if (at_start.kind == Failure::Kind::interrupted) throw;
    }
    return leads_on && modes.step_over(failure);
}

// Modes, and what hangs on them, as the step began.
void Simulation::back_to_start() {
    if (watched) {
        set_contacts(p, w, before_step.closed, before_step.mode);
        w.state = before_step;
    }
    system.read(y);
    begin_step(p, w, t, system.q, system.v);
}

// --- Accept ---------------------------------------------------------------------------------------------------------

void Simulation::accept(const Proposal& proposal, const std::optional<FoundEvent>& event) {
    ++out.steps;
    out.limited += norm.is_limited();
    const std::optional<double> to_rest = event ? std::nullopt : locator.time_to_rest();
    if (to_rest) h = past_rest * *to_rest;
    t = event ? event->time : proposal.last && !to_rest ? proposal.stop : stepper.t0 + stepper.h;
    moved_energy += system.moved_energy;
    const bool arrives = event && event->kind == FoundEvent::Kind::rest_or_limit;
    remember_directions(system, slip_at_start, arrives ? event->index : -1);
    y.head(stepper.active) = stepper.y1.head(stepper.active);
    rate.head(stepper.active) = stepper.end_rate().head(stepper.active);
    growth.look();
    output.configured_now();
    landing.remember_gaps(!event);
    output.keep_step();
    value_events.tell(t, out.events);
    if (!event || !event->changes_modes()) notices.pulls(event);
    output.inside_step(notices.several(true));
    stepper.end_directions();
    choice.choose();
    if (!event) return;
    if (event->changes_modes()) modes.change(*event);
    notices.several(false);
    if (event->kind != FoundEvent::Kind::reversal) return;
    clusters.count();
    modes.bridge(event->index);
}

// --- Record ---------------------------------------------------------------------------------------------------------

void Simulation::record(const std::optional<FoundEvent>& event) {
    if (event && event->changes_modes()) output.now();
    else output.end_step(!value_events.found().empty());
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
