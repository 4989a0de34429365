#include "run/simulation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "run/bouncing.hpp"

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
// A step of fewer spacings of floating-point times than these leads nowhere.
constexpr double least_spacings = 4.0;
// Steps below this part of the time are short enough to tell what fails of its own.
constexpr double tiny_step = 1e-10;

// A run that has come less than this part of its way after so many steps never ends.
constexpr long early_steps = 20000;
constexpr double least_progress = 1e-10;

// Progress is told after so many steps.
constexpr long steps_a_tick = 16;

// Chatter: this many events within its time make the run go on by time stepping for a while, in so many steps. Where it
// goes on right after, the while is made longer by this factor, up to the longest [s].
constexpr int chatter_events = 60;
constexpr int chatter_steps = 50;
constexpr double chatter_growth = 2.0, longest_chatter = 1e-2;

// Of the step: where directions of slip relax faster, stability holds the explicit methods short (at 3 to 6); it is
// believed after some steps in a row, and asked again some steps after it turned out otherwise.
constexpr double stiff = 2.5;
constexpr int stiff_in_a_row = 6, patience = 20;
// Where directions are not found in a step of this length [s], the method asked for has to find a way.
constexpr double shortest_sought = 1e-9;

// Part of the works of an impact that rounding may make a gain of.
constexpr double gain_rounding = 1e-12;

// Part of a step of time stepping that is not worth one of its own.
constexpr double least_part = 1e-9;
// Number of whole lengths in a time that should be a multiple of them; their quotient may miss it by so much of itself
// and of one.
constexpr double quotient_rounding = 1e-14, count_rounding = 1e-9;
double whole_lengths(double time, double length) {
    return std::floor(time / length * (1.0 + quotient_rounding) + count_rounding);
}

}  // namespace

Simulation::Simulation(const Program& program, Workspace& workspace, const Options& run_options, Recording& recording)
    : p(program), w(workspace), options(run_options), out(recording), t_end(options.end()),
      system(program, workspace, options.record.energy), norm(system, options.rtol, options.atol, rounding),
      stepper(options.method, system, norm), control(options.method, options.rtol),
      stiffness(system, stepper, *this, run_options),
      floor(system, stepper, norm, *this, recording),
      locator(system, stepper, slip_at_start, pulls, gaps), moreau(system), moreau_contacts(system),
      output(system, stepper, *this, run_options, recording), notices(system, stepper, *this, recording),
      user_events(run_options.events, system, stepper) {
    y = rate = configured_y = VecX::Zero(system.ny);
    // Time stepping finds its motion in velocities; of accelerations, which are recorded only, the nearest do.
    const bool in_time = options.method.scheme == Method::Scheme::moreau;
    w.continues = options.continues || (in_time && system.ng > 0);
    slip_at_start.assign(p.frictions.size(), 0.0);
    pulls.assign(p.contacts.size(), 0);
    gaps = GapState(p.gaps.size());
}

void Simulation::start(const VecX& q0, const VecX& v0) {
    t = options.t0;
    y.setZero();
    y.head(system.nq) = q0;
    y.segment(system.nq, system.nv) = v0;
    if (system.nz > 0) y.segment(system.nq + system.nv, system.nz) = w.state.z;
    output.begin();
    w.state.has_held = false;
    w.state.warm = false;
    sample_control();
    if (system.ng > 0) {
        set_closed(p, w, std::vector<char>(p.gaps.size(), 0));
        strike(true);
    }
    switch_modes(system, t, y, rate, std::nullopt);
    remember_gaps();
    output.now();
    notices.pulls(std::nullopt);
    notices.several(false);
    user_events.start(t, y);
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
    while (!done() && between_steps()) {
        if (in_time) {
            step_in_time(t_end, options.dt);
            continue;
        }
        Proposal proposal = propose();
        while (!control_error(proposal, integrate(proposal)) || !locate_event(proposal)) proposal = propose();
        accept(proposal, event);
        record(event);
    }
    if (t < t_end) {  // ended by the user, with a last sample here
        system.read(y);
        evaluate(p, w, t, system.q, system.v);
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
    return !options.callback || ask_callback();
}

bool Simulation::ask_callback() {
    system.read(y);
    const Options::Told told = options.callback(t, system.q, system.v, w.scratch.work);
    if (told != Options::Told::torque) return told == Options::Told::go_on;
    w.now.has_override = true;
    w.now.override_torque = w.scratch.work;
    // The torque jumps here: the derivative is taken anew.
    begin_step(p, w, t, system.q, system.v);
    system.rate_of_evaluation(t, y, rate);
    output.configured_now();
    return true;
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
    output.configured_now();
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
    if (system.ne > 0) before_step = w.state;
    stepper.y0 = y;
    stepper.y0.tail(2 * system.ne + system.ng).setZero();  // what elements watch is theirs over one step
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

// --- Locate events --------------------------------------------------------------------------------------------------

void Simulation::find_event() {
    event = locator.locate();
    if (user_events.locate(event.has_value()))
        event = FoundEvent{FoundEvent::Kind::user, user_events.found().front(), stepper.t0 + stepper.h};
}

bool Simulation::locate_event(const Proposal& proposal) {
    stiffness.look();
    floor.look();
    try {
        find_event();
        return true;
    } catch (const Failure& failure) {
        // The step taken again up to an event went where the whole one did not: it is too long.
        const double tiny = tiny_step * std::max(1.0, std::abs(t));
        if (!options.method.adaptive() || proposal.size < tiny || failure.kind == Failure::Kind::interrupted) throw;
    }
    ++out.rejected;
    h = shortened * proposal.size;
    if (system.ne > 0) {
        set_contacts(p, w, before_step.closed, before_step.mode);
        w.state = before_step;
    }
    system.read(y);
    begin_step(p, w, t, system.q, system.v);
    return false;
}

void Simulation::tell_user_events() {
    for (int k : user_events.found()) out.events.push_back({t, Event::Kind::user, k});
}

// --- Accept ---------------------------------------------------------------------------------------------------------

void Simulation::accept(const Proposal& proposal, const std::optional<FoundEvent>& event) {
    ++out.steps;
    out.limited += norm.is_limited();
    t = event ? event->time : proposal.last ? proposal.stop : stepper.t0 + stepper.h;
    moved_energy += system.moved_energy;
    remember_directions(system, slip_at_start);
    y = stepper.y1;
    rate = stepper.end_rate();
    output.configured_now();
    remember_gaps();
    output.keep_step();
    tell_user_events();
    if (!event || !event->changes_modes()) notices.pulls(event);
    output.inside_step(notices.several(true));
    stepper.end_directions();
    choose_stepper();
    if (!event) return;
    if (event->changes_modes()) change_modes(*event);
    notices.several(false);
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

void Simulation::remember_gaps() {
    if (system.ng == 0) return;
    system.read(y);
    look_at_gaps(system, t, gaps);
}

bool Simulation::strike(bool starts) {
    if (system.ng == 0 || !contacts_strike(system, t, y, starts)) return false;
    output.before_jump();
    const Strike found = strike_contacts(system, t, y, starts);
    for (const Event& event : found.events) out.events.push_back(event);
    impact_energy += found.work;
    if (system.energy && p.moves_in_time) system.work(y)[constraint_power] += found.work_of_constraints;
    else moved_energy += found.work_of_constraints;
    double size = 0.0;
    for (const Event& event : found.events) size += std::abs(event.energy_change);
    if (!options.strict || !(found.work > gain_rounding * size)) return true;
    std::vector<int> blocks;
    for (const Event& event : found.events) blocks.push_back(event.element);
    throw Failure(Failure::Kind::impact_energy, t, blocks, found.work);
}

void Simulation::change_modes(const FoundEvent& event) {
    const Modes before = w.state.mode;
    const bool struck = event.kind == FoundEvent::Kind::touch && strike(false);
    for (const Event& change : switch_modes(system, t, y, rate, event)) {
        out.events.push_back(change);
        if (!struck) recent_events.push_back(t);
    }
    remember_gaps();
    if (struck) return end_bouncing();
    if (std::equal(before.begin(), before.end(), w.state.mode.begin())) recent_events.push_back(t);
    output.configured_now();
    bridge_cluster(event.of_gap() ? 0 : event.index);
}

// What bounces too low to be integrated comes to rest.
void Simulation::end_bouncing() {
    output.now();
    output.configured_now();
    const double stop = options.output_dt > 0.0 ? std::min(next_stop(), output.next()) : next_stop();
    VecX y_end = y, rate_end = rate;
    const RunState state = w.state;
    const std::optional<Rest> rest = bounce_to_rest(system, t, stop, y_end, rate_end);
    if (!rest) {
        set_closed(p, w, state.closed);
        w.state = state;
        select_rows(p, w);
        system.read(y);
        return begin_step(p, w, t, system.q, system.v);
    }
    t = rest->time;
    y = y_end;
    rate = rate_end;
    impact_energy += rest->work;
    for (const Event& event : rest->events) out.events.push_back(event);
    output.configured_now();
    remember_gaps();
}

// Events that come too thick are bridged by time stepping, which needs none.
void Simulation::bridge_cluster(int element) {
    if (recent_events.size() > chatter_events) recent_events.erase(recent_events.begin());
    if (recent_events.size() < chatter_events || t - recent_events.front() > chatter_time) return;
    const bool again = bridged_time > 0.0 && recent_events.front() - bridged_end < bridged_time;
    recent_events.clear();
    bridged_time = again ? std::min(chatter_growth * bridged_time, longest_chatter) : chatter_time;
    const double dt = bridged_time / chatter_steps;
    if (!options.method.outside()) stiffness.require_time_steps(dt);
    out.events.push_back({t, Event::Kind::chatter, element});
    if (options.method.outside()) return;  // whose steps go on without a look at events
    const double stop = std::min(t_end, t + bridged_time);
    w.state.seeks_directions = false;
    while (t < stop) step_in_time(stop, dt);
    bridged_end = t;
    switch_modes(system, t, y, rate, std::nullopt);
    remember_gaps();
    output.configured_now();
}

// --- Record ---------------------------------------------------------------------------------------------------------

void Simulation::record(const std::optional<FoundEvent>& event) {
    if (event && event->changes_modes()) output.now();
    else output.end_step(!user_events.found().empty());
}

// --- Time stepping --------------------------------------------------------------------------------------------------

void Simulation::step_in_time(double stop, double dt) {
    sample_control();
    double end = std::min({t + dt, stop, next_stop()});
    if (options.output_dt > 0.0) end = std::min(end, std::max(output.next(), std::nextafter(t, stop)));
    if (stop - end < least_part * dt) end = stop;
    const Modes before = w.state.mode;
    const std::vector<char> closed = w.state.closed;
    const double from = t;
    const VecX y_from = options.record.dense ? y : VecX();
    if (system.ng > 0) moreau_contacts.step(t, end - t, y, moved_energy, impact_energy);
    else moreau.step(t, end - t, y, moved_energy);
    ++out.steps;
    t = end;
    system.read(y);
    // Factors of the new modes: what sticks must not move as the rest is projected.
    begin_rows(p, w, t, system.q, system.v);
    system.project_and_evaluate(t, y, rate);
    output.configured_now();
    remember_directions(system, slip_at_start);
    moved_energy += system.moved_energy;
    for (const Event& change : changes_since(system, t, closed, before)) out.events.push_back(change);
    notices.pulls(std::nullopt);
    notices.several(false);
    output.keep_time_step(from, y_from);
    user_events.look_at_end(t, y);
    tell_user_events();
    if (!user_events.found().empty()) output.now();
    output.end_time_step();
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
