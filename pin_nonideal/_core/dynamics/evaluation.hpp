// Evaluation of Eq. (40) at one state: kinematics and rows, M and its factor, given forces, laws, acceleration.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Acceleration a and multipliers lam at (t, q, v) for the modes and active rows in the workspace.
void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

// The part of it that the configuration decides: placements, M and the rows, with their factors. A user's own A may
// depend on v; where it does, a change of v has it taken anew.
void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Placements, M and the rows alone; their factors stay.
void place(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v);
// The rest, which needs the velocity: bias and given forces F, and b; then C, a and lam.
void assemble_forces(const Program& p, Workspace& w, double t, const VecX& v);
void solve_dynamics(const Program& p, Workspace& w, double t, const VecX& v);

// Kinematics and rows alone; rows of bodies in their places, without their motion; rows of bodies in motion; residuals of
// the constraints, and no more than they need.
void update_kinematics(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void place_rows(const Program& p, Workspace& w, double t, const VecX& v);
void evaluate_rows(const Program& p, Workspace& w, double t, const VecX& v);
void evaluate_residuals(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

// The row of a gap, open or closed: its residual, for bodies that are placed; its rate and drift, for bodies in motion;
// both; and these with A. A function of the user's gives them all at once.
void measure_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
void move_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
void follow_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
void evaluate_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
// Of any block, for bodies in motion.
void evaluate_block(const Program& p, Workspace& w, double t, const VecX& v, int block);

// Largest residual and rate over all rows of all descriptions at the state last evaluated; of contacts that may open
// the depth, and the rate of closed ones. Open ones that are known to be so are passed over: `sure`, by gap.
void violations(const Program& p, Workspace& w, double t, const VecX& v, double& position, double& velocity,
                const std::vector<char>* sure = nullptr);

}  // namespace pn
