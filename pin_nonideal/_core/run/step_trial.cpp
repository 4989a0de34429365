// Trial of a proposed step: integration, projection of its end, and control of its error.
#include <algorithm>
#include <cmath>

#include "math/tolerances.hpp"
#include "run/simulation.hpp"

namespace pn {

std::optional<double> Simulation::integrate(const Proposal& proposal) {
    open_loop.reset();  // valid for this step only: a shorter one may fail for another reason
    watched = system.watches();
    if (watched) before_step = w.state;
    const int active = system.active();
    stepper.y0.head(system.ns) = progress.y.head(system.ns);
    stepper.y0.segment(system.ns, active - system.ns).setZero();  // watch entries integrate over one step only
    stepper.start_rate().head(active) = progress.rate.head(active);
    try {
        return try_step(proposal);
    } catch (const Failure& failure) {
        // A stage can leave the domain if the step is too long. A shorter step shows if the motion itself fails. If the
        // motion diverges, no step is short enough, and the step-size failure is reported.
        const double tiny = tiny_step_at(progress.t);
        const bool runs_away = tiny * system.velocity(progress.rate).norm() > system.velocity(progress.y).norm();
        if (!options.method.adaptive() || (proposal.size < tiny && !runs_away) ||
            failure.kind == Failure::Kind::interrupted)
            throw;
        if (failure.kind == Failure::Kind::closure) open_loop = failure;
        back_to_start();  // rows and warm starts of the failed step do not serve the next trial
        return failed_error;
    }
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
        w.state.seeks_directions &= !stepper.collocates() || size > parameters.shortest_sought;
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
    choice.look();
    return error;
}

bool Simulation::control_error(const Proposal& proposal, std::optional<double> error) {
    const bool accepted = control.accepts(error, proposal.size, proposal.last, progress.h);
    if (accepted) open_loop.reset();
    else ++out.rejected;
    progress.may_hand_over |= !accepted;
    const double spacing = std::abs(std::nextafter(progress.t, t_end) - progress.t);
    if (accepted || !error || progress.h >= parameters.least_spacings * spacing) return accepted;
    if (open_loop) throw *open_loop;
    throw Failure(Failure::Kind::step_size, progress.t);
}

// Adaptive methods, events, law states, user functions, callbacks, checkpoints and records beyond the state need the
// acceleration at the step's end.
bool Simulation::leaves_rate(const Proposal& proposal) const {
    return stops_there && proposal.last && proposal.stop >= t_end && !options.method.adaptive() &&
           !system.has_events() && system.nz == 0 && !p.asks_functions && value_events.empty() &&
           !options.record.evaluates() && !options.record.dense && !options.callback && !options.save;
}

}  // namespace pn
