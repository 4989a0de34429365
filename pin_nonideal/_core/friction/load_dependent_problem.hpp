// Load-dependent friction problem at one state. The problem couples elements at rest with each other and with slipping
// elements of load-dependent limits.
#pragma once

#include "dynamics/reactions.hpp"
#include "friction/problem.hpp"
#include "complementarity/load_dependent/equation.hpp"

namespace pn {

class RestProblem {
public:
    RestEquation equation;

    // Set up the equation. If contacts share a load, the zero-load set of the motion without friction applies. The
    // workspace must hold the motion without friction in `resting` and `slipping` (elements with load-dependent
    // limits). On return the motion in the workspace is meaningless.
    RestProblem(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const std::vector<int>& resting,
                const std::vector<int>& slipping);
    RestProblem(const RestProblem&) = delete;  // the equation may hold a pointer to this object
    RestProblem& operator=(const RestProblem&) = delete;

    // Acceleration under forces x, if no law is a user function.
    VecX acceleration(const VecX& x) const { return without_ + problem_.response * x; }
    bool has_zero_load_sets() const { return equation.loads.rows() > 0 && shares_contact_loads(p, w); }
    // Check if forces x give a consistent motion. Then no unilateral contact has tension, and shared loads are
    // consistent with the zero-load set of the equation. freeze_zero_loads sets up the equation for the zero-load set of x.
    bool is_motion(const VecX& x);
    void freeze_zero_loads(const VecX& x);
    // Factor of the limit of the i-th element while it sticks, and after slip onset.
    double holding_factor(size_t i) const;
    double sliding_factor(size_t i) const;

private:
    const Friction& friction(size_t i) const { return p.frictions[problem_.elements[i]]; }
    void describe(size_t i, bool resting);
    void collect_loads();
    void evaluate_laws(const VecX& x, VecX& alpha, FrictionLimits& limits);
    // Set the motion in the workspace to that under forces x.
    void move(const VecX& x);

    const Program& p;
    Workspace& w;
    const double t;
    const VecX &q, &v;
    FrictionProblem problem_;
    VecX without_, lam_without_;  // acceleration and multipliers without friction
};

}  // namespace pn
