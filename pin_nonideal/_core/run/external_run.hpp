// A run whose steps an integrator outside the core takes. It asks for rates under the modes of the step at hand; the
// core follows each step, and does with it what it does with its own: the step's end is put on the constraints, it ends
// at the first event inside, and samples are recorded.
#pragma once

#include <algorithm>
#include <optional>

#include "run/simulation.hpp"

namespace pn {

class FollowedRun : public Simulation {
public:
    using Simulation::Simulation;

    // dy/dt of y = (q, v, states of laws, work of the ledger's columns), and its derivatives by y by central differences.
    void derivative(double at, const VecX& y_outside, VecX& rate_outside);
    MatX jacobian(double at, const VecX& y_outside);
    // Follows a step from the present state to one at `end`; whether the integrator has to start again, from the present
    // state as it is then.
    bool follow(double end, const OutsideStep::Interpolant& interpolant);

    // The time at which the integrator's next step has to end: the next break of a function of time, `end` at most.
    double stop_before(double end) {
        if (p.searches_breaks) breaks.look(end);
        return std::min(end, breaks.next());
    }

    // An element of several directions whose slip begins from rest so slowly, beside the acceleration that its friction
    // alone would cause, that its direction relaxes faster than any step of an integrator without that direction among
    // its unknowns; none at most states.
    std::optional<int> singular_onset();

    double time() const { return t; }
    using Simulation::done;
    VecX state() const { return y.head(system.ns); }
    VecX state_rate() const { return rate.head(system.ns); }

private:
    bool bridges_cluster() const;

    VecX inside_, inside_rate_;
    double moved_before_ = 0.0;  // energy, by projections that the integrator went on from
};

}  // namespace pn
