// Evaluation of Eq. (40) at one state, and the choice of independent rows.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// The heart: acceleration a and multipliers lam at (t, q, v) for the modes and active rows in the workspace.
void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The same after the state was put on the constraints.
void evaluate_on_constraints(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
// The part of it that the configuration decides: placements, M and the rows, with their factors. A user's own A may
// depend on v; where it does, a change of v has it taken anew.
void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v);
// Residuals of the constraints, and no more than they need.
void gaps(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Motion and rows at a state, rows, M's factor, rows in its metric.
void look_at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void evaluate_rows(const Program& p, Workspace& w, double t, const VecX& v);
void factor_mass(const Program& p, Workspace& w, double t);
void scale_rows(const Program& p, Workspace& w);
// a and lam for the given force F + C, by the factors in the workspace; refined where light bodies spoil them.
void solve_motion(const Program& p, Workspace& w, const VecX& force);
// Given forces and actuation into w.now.tau and w.now.external.
void given_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void actuation_torque(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& tau);

// Rows that must hold: constraints, and elements that stick elsewhere than in a joint (a joint that sticks is locked
// instead, which costs less than letting it move). All of them count as independent until begin_step.
void want_rows(const Program& p, Workspace& w);
// Evaluates at a step's start and decides which rows are independent here; contradicting rows are a failure.
void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The same where the workspace is configured, after v was brought to A v + phi_t = 0; returns whether v moved.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v);

// Whether sticking elements and constraints leave no freedom at all: then nothing moves, exactly.
bool is_immobile(const Program& p, const Workspace& w);
// Forces that hold the locked dofs, for the motion in the workspace.
const VecX& holding_forces(const Program& p, Workspace& w);

// lam_shared from lam: redundant rows share the load with least norm (in the user's row scale).
void share_multipliers(const Program& p, Workspace& w);
// The motion of the ideal constraints: without C, and without what sticks. The workspace holds it, with its factors,
// while this object lives; then the factors are again those of the modes, and a and lam are left to the caller.
class IdealMotion {
public:
    IdealMotion(const Program& p, Workspace& w);
    ~IdealMotion();
    IdealMotion(const IdealMotion&) = delete;
    IdealMotion& operator=(const IdealMotion&) = delete;

private:
    const Program& p;
    Workspace& w;
    bool sticks = false;
};
struct Split {
    VecX F_ideal, F_nonideal, C, lam, lam_ideal;  // multipliers by row of the descriptions
};
// Eq. (39): ideal and nonideal part of the force of constraint at the state last evaluated.
void split_forces(const Program& p, Workspace& w, Split& out);

// Largest residual and rate over all rows of all descriptions at the state last evaluated.
void violations(const Program& p, const Workspace& w, double& position, double& velocity);

}  // namespace pn
