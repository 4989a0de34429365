#include "run/simulation.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "dynamics/evaluation.hpp"
#include "dynamics/law_residuals.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "math/tolerances.hpp"
#include "run/events/mode_selection.hpp"

namespace pn {

Simulation::Simulation(const Program& program, Workspace& workspace, const Options& run_options, Recording& recording)
    : p(program), w(workspace), options(run_options), out(recording), t_end(options.end()),
      run_limits(run_options, workspace, progress, recording), system(program, workspace, options.record.energy),
      norm(system, options.rtol, options.atol, progress.rounding), stepper(options.method, system, norm),
      control(options.method, options.rtol, progress.trials), choice(system, stepper, progress, run_options),
      stiffness(system, stepper, progress, run_options),
      floor(system, stepper, norm, progress, recording), growth(system, progress, run_options, recording),
      watch(system, progress.gaps),
      locator(system, stepper, norm, progress.slip_at_start, progress.in_tension, watch), hand_over(system, progress),
      output(system, stepper, progress, run_options, recording), warnings(system, stepper, progress, recording),
      value_events(run_options.events, system, stepper, progress), breaks(system, progress, output, recording),
      torques(system, progress, run_options, output, breaks),
      impacts(system, progress, watch, run_options, output, recording),
      time_stepping(system, progress, watch, run_options, torques, output, warnings, value_events, recording),
      chatter(system, progress, run_options, stiffness, time_stepping, recording),
      modes(system, progress, run_options, torques, output, impacts, time_stepping, chatter, recording) {
    progress.y = progress.rate = progress.configured_y = VecX::Zero(system.ny);
    // Time stepping solves for velocities. Accelerations are only recorded, so the solution nearest to the last one
    // suffices.
    const bool in_time = options.method.scheme == Method::Scheme::moreau;
    w.continues = options.continues || (in_time && system.ng > 0);
    progress.slip_at_start.assign(p.frictions.size(), 0.0);
    progress.in_tension.assign(p.contacts.size(), 0);
}

void Simulation::start(const VecX& q0, const VecX& v0) {
    progress.t = options.t0;
    progress.is_stationary = false;
    progress.y.setZero();
    progress.y.head(system.nq) = q0;
    progress.y.segment(system.nq, system.nv) = v0;
    if (system.nz > 0) progress.y.segment(system.nq + system.nv, system.nz) = w.state.z;
    w.now.dependent_at_start = -1;
    progress.trials = {};
    progress.misses_laws = false;
    modes.start();
    output.begin();
    breaks.enter();
    w.state.has_held = false;
    w.state.warm = false;
    torques.sample();
    if (system.ng > 0) {
        set_closed(p, w, std::vector<char>(p.gaps.size(), 0));
        impacts.resolve_impacts(true);
    }
    if (options.method.scheme == Method::Scheme::moreau && system.ng > 0) {
        time_stepping.begin(options.dt);
    } else {
        switch_modes(system, progress.t, progress.y, progress.rate, std::nullopt);
        impacts.remember_gaps();
    }
    output.now();
    warnings.check_tension(std::nullopt);
    warnings.check_uniqueness(false);
    value_events.start(progress.t, progress.y);
    progress.h = options.dt;
    if (options.method.adaptive()) {
        progress.h = norm.initial_step(options.method.order, progress.t, progress.y, progress.rate, t_end - progress.t);
        system.read(progress.y);
        begin_step(p, w, progress.t, system.q, system.v);
    }
    output.configured_now();
}

void Simulation::run() {
    const bool in_time = options.method.scheme == Method::Scheme::moreau;
    while (!done() && between_steps()) {
        if (in_time) {
            time_stepping.step(options.dt, t_end, t_end);
            growth.check_step();
            continue;
        }
        Proposal proposal;
        const auto failure = attempt([&] {
            proposal = propose();
            while (!control_error(proposal, integrate(proposal)) || !locate_event(proposal)) proposal = propose();
        });
        if (failure) {
            if (!recover(*failure)) throw *failure;
            continue;
        }
        accept(proposal, event);
        record(event);
        modes.bridge_stalled_steps();
    }
    if (progress.t < t_end) {  // ended by the user: record a last sample
        system.read(progress.y);
        if (!w.now.no_motion) evaluate(p, w, progress.t, system.q, system.v);
        output.now();
    }
    run_limits.save();
}

bool Simulation::between_steps() {
    run_limits.check();
    return !options.callback || torques.call_callback();
}

void Simulation::restore(const std::string& state) {
    from_bytes(state, system, progress, out);
}

// --- Propose --------------------------------------------------------------------------------------------------------

Simulation::Proposal Simulation::propose() {
    if (breaks.reached()) pass_break();
    torques.sample();
    const bool adaptive = options.method.adaptive();
    const std::optional<double> before_hand_over = pass_hand_overs();
    if (p.searches_breaks) breaks.find_in_step(std::min(t_end, progress.t + (adaptive ? progress.h : options.dt)), adaptive);
    double stop = torques.next_stop(progress.t, t_end);
    if (!adaptive)  // stay on the fixed grid, also after an event inside a step
        stop = std::min(stop, options.t0 + (whole_lengths(progress.t - options.t0, options.dt) + 1.0) * options.dt);
    const double remaining = stop - progress.t;
    double size = adaptive ? progress.h : remaining;
    if (adaptive && p.changes_at_rest() && (system.velocity(progress.y).array() == 0.0).all()) {
        const double since = out.events.empty() ? options.t0 : out.events.back().time;
        size = std::min(size, std::max(parameters.rest_step, parameters.rest_part_step * (progress.t - since)));
    }
    bool last = false;
    if (size >= remaining * parameters.whole_way) {
        size = remaining;
        last = true;
    } else if (size > parameters.even_part * remaining) {
        size = parameters.even_part * remaining;
    }
    if (!adaptive && !p.frictions.empty()) {
        const double shorter = locator.shorten_toward_rest(progress.rate, size);
        last &= shorter == size;
        size = shorter;
    }
    if (before_hand_over && *before_hand_over < size) {
        size = *before_hand_over;
        last = false;
    }
    return {size, stop, last};
}

// Steps without error control are searched always, other steps after a rejection, as a hand-over causes one. Contacts of
// bodies without a load open at once: near a hand-over their rows can turn singular.
std::optional<double> Simulation::pass_hand_overs() {
    const bool adaptive = options.method.adaptive();
    hand_over_ahead = false;
    if (system.ng == 0 || (adaptive && !progress.may_hand_over)) return std::nullopt;
    bool may_release = true;
    for (;;) {
        const double size =
            std::min(adaptive ? progress.h : options.dt, torques.next_stop(progress.t, t_end) - progress.t);
        const std::optional<HandOver::Found> next = hand_over.first(size);
        progress.may_hand_over = next.has_value();
        if (!next || next->time >= size * parameters.whole_way) return std::nullopt;  // passed in the step after a stop
        if (hand_over.is_reached(next->time)) {
            hand_over.pass(next->time);
            progress.hand_over_time = progress.t;
        } else if (!std::exchange(may_release, false) || !hand_over.is_unloaded(next->gap)) {
            hand_over_ahead = true;
            return HandOver::step_before(next->time);
        }
        modes.change(FoundEvent::hand_over(progress.t));
        output.now();
    }
}

void Simulation::pass_break() {
    if (!breaks.pass()) return;
    if (system.has_events()) modes.change({FoundEvent::Kind::touch, -1, progress.t});
    output.now();
}

// --- Integrate ------------------------------------------------------------------------------------------------------

std::optional<double> Simulation::integrate(const Proposal& proposal) {
    open_loop.reset();  // valid for this step only: a shorter one may fail for another reason
    watched = system.watches();
    if (watched) before_step = w.state;
    guess = w.state.unknown;
    guessed_wrench = w.state.bearing_wrench;
    has_guessed_wrench = w.state.has_wrenches;
    has_guess = w.state.warm;
    const int active = system.active();
    stepper.y0.head(system.ns) = progress.y.head(system.ns);
    stepper.y0.segment(system.ns, active - system.ns).setZero();  // watch entries integrate over one step only
    stepper.start_rate().head(active) = progress.rate.head(active);
    std::optional<double> error;
    const auto failure = attempt([&] { error = try_step(proposal); });
    if (!failure) return error;
    // A stage can leave the domain if the step is too long. A shorter step shows if the motion itself fails. If the motion
    // diverges, no step is short enough, and the step-size failure is reported.
    const double tiny = tiny_step_at(progress.t);
    const bool runs_away = failure->kind != Failure::Kind::inconsistent &&
                           tiny * system.velocity(progress.rate).norm() > system.velocity(progress.y).norm();
    if (!options.method.adaptive() || (proposal.size < tiny && !runs_away)) throw *failure;
    if (failure->kind == Failure::Kind::closure) open_loop = failure;
    back_to_start();  // rows and warm starts of the failed step do not serve the next trial
    return failed_error;
}

// Take one step. If its error is accepted, project and evaluate its end.
std::optional<double> Simulation::try_step(const Proposal& proposal) {
    const double size = proposal.size;
    const double start_pivot = w.now.rows.distance;
    system.on_constraints = start_pivot < near_singular_pivot && !w.now.rows.blocks.empty();
    system.smallest_pivot = 1.0;
    stepper.take(progress.t, size);
    if (system.smallest_pivot < near_singular_pivot && !system.on_constraints) {
        system.on_constraints = true;
        stepper.take(progress.t, size);
    }
    if (!stepper.y1.head(stepper.active).allFinite()) throw Failure(Failure::Kind::not_finite, progress.t + size);
    if (control.needs_detour(system.smallest_pivot, start_pivot, w.now.rows.distance)) return std::nullopt;
    const bool needs_end = options.method.first_same_as_last && !stepper.collocates();
    double error = needs_end ? 0.0 : stepper.error();
    if (!(error <= 1.0)) {
        w.state.solves_directions &= !stepper.collocates() || size > parameters.shortest_sought;
        return error;
    }
    const bool measures = p.driven_exactly && options.method.adaptive() &&
                          size > parameters.shortest_measured * std::max(1.0, std::abs(progress.t));
    if (measures) {
        projection_move = stepper.y1;
        w.now.projected_gap = w.now.projected_rate = 0.0;
    }
    if (!leaves_rate(proposal) || !system.is_on_constraints(progress.t + size, stepper.y1))
        system.project_and_evaluate(progress.t + size, stepper.y1, stepper.end_rate());
    stepper.learn();
    if (needs_end) error = stepper.error();
    if (measures) {
        // If constraints drive the motion, the stages do not contain this error. The projection removes it, so its move
        // is measured.
        projection_move -= stepper.y1;
        error = std::max(error, norm.of_projection(projection_move, stepper.y0, stepper.y1, progress.t, size));
    }
    choice.check_step();
    return error;
}

// --- Control the error ----------------------------------------------------------------------------------------------

bool Simulation::control_error(const Proposal& proposal, std::optional<double> error) {
    const bool accepted = control.accepts(error, proposal.size, proposal.last, progress.h);
    if (accepted) open_loop.reset();
    else {
        ++out.rejected;
        restore_guess();
    }
    progress.may_hand_over |= !accepted;
    const double spacing = std::abs(std::nextafter(progress.t, t_end) - progress.t);
    if (accepted || !error || progress.h >= parameters.min_step_spacings * spacing) return accepted;
    if (open_loop) throw *open_loop;
    throw Failure(Failure::Kind::step_size, progress.t);
}

// --- Locate events --------------------------------------------------------------------------------------------------

void Simulation::find_event() {
    event.reset();
    if (system.has_events())
        if (const auto located = locator.locate()) event = *located;
    if (!value_events.empty() && value_events.locate(event.has_value()))
        event = FoundEvent{FoundEvent::Kind::user, value_events.found().front(), stepper.t0 + stepper.h};
    // A motion that violates a law ends here, and modes are selected anew.
    if (system.has_events() && !(event && event->changes_modes()) && !satisfies_laws())
        event = FoundEvent::joint_lift(stepper.t0 + stepper.h);
}

// Check the laws of the motion at the step's end.
bool Simulation::satisfies_laws() {
    MotionState state;
    if (options.method.adaptive() && !options.method.outside()) state.slip_error = 1.0 / norm.of_speed(1.0);
    state.is_end = true;
    system.read(stepper.y1);
    return check_laws(p, w, stepper.t0 + stepper.h, system.q, system.v, state).are_small();
}

bool Simulation::locate_event(const Proposal& proposal) {
    stiffness.check_step();
    floor.check_step();
    const auto failure = attempt([&] { find_event(); });
    if (!failure) return true;
    // The repeated step failed although the whole step did not, so the step is too long.
    if (!options.method.adaptive() || proposal.size < tiny_step_at(progress.t)) throw *failure;
    ++out.rejected;
    progress.may_hand_over = true;
    progress.h = parameters.shortened * proposal.size;
    back_to_start();
    return false;
}

// Adaptive methods, events, law states, user functions, callbacks, checkpoints and records beyond the state need the
// acceleration at the step's end.
bool Simulation::leaves_rate(const Proposal& proposal) const {
    return stops_there && proposal.last && proposal.stop >= t_end && !options.method.adaptive() &&
           !system.has_events() && system.nz == 0 && !p.changes_at_rest() && value_events.empty() &&
           !options.record.evaluates() && !options.record.dense && !options.callback && !options.save;
}

// If no step is short enough, continue from the step's start with other modes or by time stepping. Return false if
// neither applies.
bool Simulation::recover(const Failure& failure) {
    const bool can_switch_modes = modes.can_switch_modes(failure);
    const bool at_hand_over = hand_over_ahead || progress.t - progress.hand_over_time <= ChatterDetector::parameters.window;
    const bool of_hand_over =
        (at_hand_over && ModeChanges::is_of_closed_contacts(failure)) || modes.is_of_contradicting_contacts(failure);
    const bool of_drive = modes.contradicts_drive(failure);
    const bool is_recoverable = of_hand_over || ModeChanges::is_recoverable(failure) || modes.takes_any_motion(failure);
    if (!can_switch_modes && !is_recoverable && !of_drive) return false;
    bool has_switched = false;
    attempt([&] {  // a failure means that the current modes have no motion at the step's start
        back_to_start();
        has_switched = can_switch_modes && modes.force_switch();
    });
    return has_switched || modes.bridge_with_time_stepping(failure, of_hand_over) || (of_drive && modes.follow_drive());
}

// Do not use the loads of a diverged stage as a guess for a shorter step.
void Simulation::restore_guess() {
    w.state.unknown = guess;
    w.state.bearing_wrench = guessed_wrench;
    w.state.has_wrenches = has_guessed_wrench;
    w.state.warm = has_guess;
}

// Restore the modes and the dependent rows and forces of the step's start.
void Simulation::back_to_start() {
    if (watched) {
        set_contacts(p, w, before_step.closed, before_step.mode);
        w.state = before_step;
    }
    restore_guess();
    system.read(progress.y);
    begin_step(p, w, progress.t, system.q, system.v);
}

// --- Accept ---------------------------------------------------------------------------------------------------------

void Simulation::accept(const Proposal& proposal, const std::optional<FoundEvent>& event) {
    ++out.steps;
    out.limited += norm.is_limited();
    const std::optional<double> to_rest = event ? std::nullopt : locator.time_to_rest();
    if (to_rest) progress.h = parameters.past_rest * *to_rest;
    else if (const auto size = event ? std::nullopt : locator.step_after_stop()) progress.h = std::min(progress.h, *size);
    progress.t = event ? event->time : proposal.last && !to_rest ? proposal.stop : stepper.t0 + stepper.h;
    progress.numerical_energy += system.numerical_energy;
    const bool arrives = event && event->kind == FoundEvent::Kind::rest_or_limit;
    remember_directions(system, progress.slip_at_start, arrives ? event->index : -1);
    progress.y.head(stepper.active) = stepper.y1.head(stepper.active);
    progress.rate.head(stepper.active) = stepper.end_rate().head(stepper.active);
    growth.check_step();
    output.configured_now();
    impacts.remember_gaps(!event);
    output.keep_step();
    value_events.append_events(progress.t, out.events);
    if (!event || !event->changes_modes()) warnings.check_tension(event);
    output.inside_step(warnings.check_uniqueness(true));
    stepper.end_directions();
    choice.choose();
    if (!event) return;
    if (event->changes_modes()) modes.change(*event);
    warnings.check_uniqueness(false);
    if (event->kind != FoundEvent::Kind::reversal) return;
    chatter.count();
    modes.bridge_chatter(event->index);
}

// --- Record ---------------------------------------------------------------------------------------------------------

void Simulation::record(const std::optional<FoundEvent>& event) {
    if (event && event->changes_modes()) output.now();
    else output.end_step(!value_events.found().empty());
}

}  // namespace pn
