// Projection onto the constraints after a step, in the metric of M. Newton's method solves phi(q, t) = 0 with the
// factors of the step's last evaluation. One solve with the factors of the next step then gives A v + phi_t = 0.
#pragma once

#include "dynamics/constraint_gaps.hpp"

namespace pn {

struct ProjectionParameters {
    // Past its first steps an iteration that keeps more than this fraction of the largest residual has converged to
    // rounding. Newton's method at least halves the residual near the constraints. The first steps may start far away.
    double stall_ratio = 0.5;
    int sure_position_steps = 3, sure_velocity_steps = 1;  // first steps, which `stall_ratio` does not judge
    // Maximum fraction of an earlier step that an iteration step may keep. Steps above it carry no information about
    // the change of the rows since their factorization.
    double broyden_limit = 0.3;
    // A step with an expected residual below this fraction of rounding is not evaluated separately.
    double trusted_part = 0.5;
    // The third-order part of a step's move is used if its square is below this fraction of the second-order part's
    // square.
    double falling_square = 0.01;
    // Smallest change of the residual of a user's row by a displacement of unit length. The inverse is the largest change.
    // Rows beyond these bounds have other units than meters and radians.
    double small_row = 1e-2;
    // Below this speed [rad/s or m/s] rows change only by rounding over a step of time stepping.
    double slow_speed = 1e-5;
    // Factorization at the new position costs less than this many iterations.
    double iterations_for_factors = 3.0;
    // Near a singular position the floor is zero. Iteration counts then assume convergence to unit roundoff.
    double no_floor = 1e-16;
};

inline constexpr ProjectionParameters projection_parameters{};

// Add the least move that follows the constraints to third order to a step's move h v1, v1 = v0 + h a. Without it the
// gap is h^2/2 b, because h v0 + h^2/2 a follows the constraints to second order. The gap of order h^3 comes from
// projections after earlier steps. The workspace must hold (v0, a).
void follow_constraints(const Program& p, Workspace& w, double h, VecX& move);
// Update the gap of order h^3 after the projection at the end of such a step.
void learn_third_order(const Program& p, Workspace& w, double h);

// Project q. Return false if nothing had to move. The workspace must hold factors near (t, q) and is configured there on
// return. Only a user's own rows read v. `is_configured`: the workspace is already configured at (t, q). `keeps_factors`: if
// the old factors are accurate enough, keep them for a velocity projection only. M and the rows are those of q.
bool project_position(const Program& p, Workspace& w, double t, VecX& q, const VecX& v, bool is_configured = false,
                      bool keeps_factors = false);
// Project v. Return false if nothing had to move. The workspace must be configured at (t, q).
bool project_velocity(const Program& p, Workspace& w, double t, VecX& v);
// Check if q and v satisfy all rows in use, dependent rows included, without factorization. Return false if the state
// moves fast enough to leave the rows by more than rounding over a step. Set the velocity of locked dofs, and of a dof
// that a sticking row holds alone, to exactly zero.
bool keeps_to_rows(const Program& p, Workspace& w, double t, const VecX& q, VecX& v);
// Check if q and v satisfy the constraints within the tolerances of projection. Evaluates rows and rates without
// factorization.
bool is_on_constraints(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

// Remove the part of a small change of the velocity or position that a projection would remove. Uses the factors in the
// workspace. Nonholonomic rows bind velocities only, so projection of a position ignores them.
void remove_normal_velocity(const Program& p, Workspace& w, Eigen::Ref<VecX> change);
void remove_normal_move(const Program& p, Workspace& w, Eigen::Ref<VecX> move);

}  // namespace pn
