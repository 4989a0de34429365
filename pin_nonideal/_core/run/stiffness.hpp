// Whether a run crawls because it is stiff: its steps are as long as an explicit method is stable, however smooth the
// motion, and more of them are left than it may take.
#pragma once

#include "run/checkpoint.hpp"
#include "run/stepper.hpp"

namespace pn {

class StiffnessGuard {
public:
    // The most steps that a stiff run may take; 0: the usual number.
    StiffnessGuard(System& system, Stepper& stepper, Progress& progress, double t_end, long most_steps);

    // After a step that the error control accepts, with the workspace evaluated at its end, and left so. Throws a Failure
    // with the dof that is stiff, and its rate [1/s].
    void look();
    // The same at once, unless what decays fastest lets time stepping take steps of this size.
    void require_time_steps(double size);

private:
    struct FastestMode {
        double decay, frequency;  // [1/s]
        int dof;                  // whose force does most to it
    };

    double stage_rate() const;
    VecX difference(const VecX& direction, VecX& force);
    FastestMode fastest_mode();

    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    const double t_end_, most_steps_;
    VecX probe_, probe_rate_;
};

}  // namespace pn
