#include "run/simulation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/step_start.hpp"
#include "run/events/events.hpp"

namespace pn {

Simulation::Simulation(const Program& program, Workspace& workspace, const Options& run_options, Recording& recording)
    : p(program), w(workspace), options(run_options), out(recording), t_end(options.end()),
      run_limits(run_options, workspace, progress, recording), system(program, workspace, options.record.energy),
      norm(system, options.rtol, options.atol, progress.rounding), stepper(options.method, system, norm),
      control(options.method, options.rtol), choice(system, stepper, progress, run_options),
      stiffness(system, stepper, progress, run_options),
      floor(system, stepper, norm, progress, recording), growth(system, progress, run_options, recording),
      watch(system, progress.gaps),
      locator(system, stepper, norm, progress.slip_at_start, progress.in_tension, watch), hand_over(system, progress),
      output(system, stepper, progress, run_options, recording), notices(system, stepper, progress, recording),
      value_events(run_options.events, system, stepper, progress), breaks(system, progress, output, recording),
      torques(system, progress, run_options, output, breaks),
      landing(system, progress, watch, run_options, output, recording),
      time_stepping(system, progress, watch, run_options, torques, output, notices, value_events, recording),
      clusters(system, progress, run_options, stiffness, time_stepping, recording),
      modes(system, progress, run_options, torques, output, landing, clusters, recording) {
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
    output.begin();
    breaks.enter();
    w.state.has_held = false;
    w.state.warm = false;
    torques.sample();
    if (system.ng > 0) {
        set_closed(p, w, std::vector<char>(p.gaps.size(), 0));
        landing.strike(true);
    }
    if (options.method.scheme == Method::Scheme::moreau && system.ng > 0) {
        time_stepping.begin(options.dt);
    } else {
        switch_modes(system, progress.t, progress.y, progress.rate, std::nullopt);
        landing.remember_gaps();
    }
    output.now();
    notices.pulls(std::nullopt);
    notices.several(false);
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
            growth.look();
            continue;
        }
        Proposal proposal;
        try {
            proposal = propose();
            while (!control_error(proposal, integrate(proposal)) || !locate_event(proposal)) proposal = propose();
        } catch (const Failure& failure) {
            if (!goes_on(failure)) throw;
            continue;
        }
        accept(proposal, event);
        record(event);
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
    return !options.callback || torques.ask_callback();
}

void Simulation::restore(const std::string& state) {
    from_bytes(state, system, progress, out);
    breaks.enter();
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
        // The repeated step failed although the whole step did not, so the step is too long.
        const double tiny = tiny_step_at(progress.t);
        if (!options.method.adaptive() || proposal.size < tiny || failure.kind == Failure::Kind::interrupted) throw;
    }
    ++out.rejected;
    progress.may_hand_over = true;
    progress.h = parameters.shortened * proposal.size;
    back_to_start();
    return false;
}

// If no step is short enough, continue from the step's start with other modes or by time stepping. Return false if
// neither applies.
bool Simulation::goes_on(const Failure& failure) {
    const bool may_end = modes.may_end(failure);
    const bool at_hand_over = hand_over_ahead || progress.t - progress.hand_over_time <= Clusters::parameters.window;
    const bool of_hand_over = at_hand_over && ModeChanges::of_closed_contacts(failure);
    const bool leads_on = of_hand_over || ModeChanges::leads_on(failure);
    if (!may_end && !leads_on) return false;
    try {
        back_to_start();
        if (may_end && modes.leave()) return true;
    } catch (const Failure& at_start) {  // the current modes have no motion at the step's start
        if (at_start.kind == Failure::Kind::interrupted) throw;
    }
    return leads_on && modes.step_over(failure, of_hand_over);
}

// Restore the modes and the dependent rows and forces of the step's start.
void Simulation::back_to_start() {
    if (watched) {
        set_contacts(p, w, before_step.closed, before_step.mode);
        w.state = before_step;
    }
    system.read(progress.y);
    begin_step(p, w, progress.t, system.q, system.v);
}

// --- Accept ---------------------------------------------------------------------------------------------------------

void Simulation::accept(const Proposal& proposal, const std::optional<FoundEvent>& event) {
    ++out.steps;
    out.limited += norm.is_limited();
    const std::optional<double> to_rest = event ? std::nullopt : locator.time_to_rest();
    if (to_rest) progress.h = parameters.past_rest * *to_rest;
    progress.t = event ? event->time : proposal.last && !to_rest ? proposal.stop : stepper.t0 + stepper.h;
    progress.numerical_energy += system.numerical_energy;
    const bool arrives = event && event->kind == FoundEvent::Kind::rest_or_limit;
    remember_directions(system, progress.slip_at_start, arrives ? event->index : -1);
    progress.y.head(stepper.active) = stepper.y1.head(stepper.active);
    progress.rate.head(stepper.active) = stepper.end_rate().head(stepper.active);
    growth.look();
    output.configured_now();
    landing.remember_gaps(!event);
    output.keep_step();
    value_events.tell(progress.t, out.events);
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

}  // namespace pn
