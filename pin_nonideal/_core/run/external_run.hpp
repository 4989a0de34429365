// Run whose steps are taken by an integrator outside the core. The integrator evaluates rates under the modes of the
// current step. The core then treats each step like its own. The core projects the step's end onto the constraints, ends the
// step at the first event inside, and records samples.
#pragma once

#include <algorithm>
#include <optional>

#include "run/simulation.hpp"

namespace pn {

struct ExternalRunParameters {
    // Relative step of central differences: cube root of the unit roundoff, which balances rounding and truncation
    // errors.
    double derivative_step = 6e-6;
    // Minimum slip acceleration at an onset, relative to the acceleration due to friction alone. The inverse ratio is the
    // rate at which the slip direction relaxes, times the time since the onset. Implicit steps resolve inverse ratios up to
    // about 30.
    double min_onset_acceleration = 1.0 / 30.0;
};

class ExternalRun : public Simulation {
public:
    using Parameters = ExternalRunParameters;
    static constexpr Parameters parameters{};

    using Simulation::Simulation;

    // Compute dy/dt of y = (q, v, law states, work of the ledger's columns), and its Jacobian by y with central
    // differences.
    void derivative(double time, const VecX& y_outside, VecX& rate_outside);
    MatX jacobian(double time, const VecX& y_outside);
    // Follow a step from the current state to one at time `end`. Return true if the integrator must restart from the
    // current state.
    bool follow(double end, const OutsideStep::Interpolant& interpolant);

    // Return the latest end time of the integrator's next step: the next break of a time function, at most `end`.
    double stop_before(double end) {
        if (p.searches_breaks) breaks.find_in_step(end);
        return std::min(end, breaks.next());
    }

    // Return an element with several slip directions whose slip begins very slowly from rest, if there is one. Slow is
    // relative to the acceleration due to its friction alone. The slip direction then relaxes faster than any step of an
    // integrator that does not solve for the direction.
    std::optional<int> singular_onset();

    double time() const { return progress.t; }
    using Simulation::done;
    VecX state() const { return progress.y.head(system.ns); }
    VecX state_rate() const { return progress.rate.head(system.ns); }

private:
    bool bridges_cluster() const;

    VecX inside_, inside_rate_;
    double numerical_energy_before_ = 0.0;  // projection energy up to the state from which the integrator continues
};

}  // namespace pn
