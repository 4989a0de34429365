#include "run/external_run.hpp"

#include <algorithm>

#include "dynamics/projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "friction/stick_slip.hpp"
#include "friction/problem.hpp"
#include "math/tolerances.hpp"

namespace pn {

void ExternalRun::derivative(double time, const VecX& y_outside, VecX& rate_outside) {
    inside_ = inside_rate_ = VecX::Zero(system.ny);
    inside_.head(system.ns) = y_outside;
    system.derivative(time, inside_, inside_rate_);
    rate_outside = inside_rate_.head(system.ns);
}

// Positions use an absolute step, which stays small after many turns of a joint.
MatX ExternalRun::jacobian(double time, const VecX& y_outside) {
    const int n = system.ns;
    MatX out = MatX::Zero(n, n);
    VecX ahead = y_outside, back = y_outside, rate_ahead(n), rate_back(n);
    for (int k = 0; k < n - system.nw; ++k) {
        const double step = parameters.derivative_step * (k < system.nq ? 1.0 : std::max(1.0, std::abs(y_outside[k])));
        ahead[k] += step;
        back[k] -= step;
        derivative(time, ahead, rate_ahead);
        derivative(time, back, rate_back);
        out.col(k) = (rate_ahead - rate_back) / (ahead[k] - back[k]);
        ahead[k] = back[k] = y_outside[k];
    }
    return out;
}

std::optional<int> ExternalRun::singular_onset() {
    for (int e : w.now.slipping) {
        const Friction& friction = p.frictions[e];
        if (friction.dim == 1 || !at_rest(p, w, e, system.v)) continue;
        const FrictionProblem problem(p, w, {e});
        const double by_friction = w.now.limit[e] * problem.W.trace() / friction.dim;
        if (slip_rate_along_mode(p, w, e) < parameters.min_onset_acceleration * by_friction) return e;
    }
    return std::nullopt;
}

// Check if a chatter event was recorded less than `ChatterParameters::window` ago. Implicit steps then keep the modes and
// locate no events.
bool ExternalRun::bridges_cluster() const {
    return !out.events.empty() && out.events.back().kind == Event::Kind::chatter &&
           progress.t < out.events.back().time + ChatterDetector::parameters.window;
}

bool ExternalRun::follow(double end, const OutsideStep::Interpolant& interpolant) {
    between_steps();
    progress.numerical_energy = numerical_energy_before_;
    stepper.y0 = progress.y;
    stepper.start_rate() = progress.rate;
    stepper.follow(progress.t, end - progress.t, interpolant);
    system.project_and_evaluate(end, stepper.y1, stepper.end_rate());
    event.reset();
    if (!bridges_cluster()) find_event();
    accept({stepper.h, end, true}, event);
    record(event);
    system.on_constraints = w.now.rows.distance < near_singular_pivot && !w.now.rows.blocks.empty();
    const bool breaks_here = breaks.reached() && !done();
    if (breaks_here) pass_break();
    if (event || breaks_here || options.method.one_step) numerical_energy_before_ = progress.numerical_energy;
    return event.has_value() || breaks_here;
}

}  // namespace pn
