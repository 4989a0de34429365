// Back onto the constraints after a step, in the metric of M: phi(q, t) = 0 by Newton's method with the factors of the
// step's last evaluation, and there A v + phi_t = 0 by one solve with the factors that the next step needs anyway.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Residuals below this part of the scene's size are rounding: a few hundred operations of unit roundoff.
constexpr double projection_floor = 2e-14;
// A pivot of the rows' unit-diagonal factor below this is near a singular position: the square of the sine at which
// the nearest row stands to the others.
constexpr double near_singular = 2.5e-3;
// A step of the iteration that keeps more than this part of an earlier one says nothing of how the rows have changed
// since their factors were taken.
constexpr double broyden_limit = 0.3;
// A step after which the residual should be below this part of rounding is not evaluated by itself.
constexpr double trusted_part = 0.5;
// The third-order part of a step's move counts where its square is less than this part of that of the second.
constexpr double falling_square = 0.01;
// Where nothing can move, a velocity below this [rad/s or m/s] is what the last event left by rounding.
constexpr double immobile_speed = 1e-8;
// Slower than this [rad/s or m/s] rows turn by rounding only over a step of time stepping.
constexpr double slow_speed = 1e-5;

// A larger gap than this part of the scene's size that projection leaves has opened for good: after every step it comes
// down to rounding, in singular positions too.
constexpr double open_gap = 1e-9;

// What sticks gives way to a gap of this part of the scene's size in rows that count as dependent.
constexpr double creeping_gap = 1e-11;

// To a step's move h v1, v1 = v0 + h a, adds the least one that follows the constraints to third order. Without it gaps are
// h^2/2 b, since h v0 + h^2/2 a is what follows them to second order; the multipliers of h^3 are those that the projection
// after the step before has shown. The workspace is that of (v0, a).
void follow_constraints(const Program& p, Workspace& w, double h, VecX& move);
// Keeps them, after the projection of the end of a step that was moved so.
void learn_third_order(Workspace& w, double h);

// Each returns false when nothing had to move.
// Moves q; the workspace must hold factors near (t, q), and is left configured there. v is only what a user's own rows are
// shown.
// `configured`: it is there already. `keeps_factors`: where these serve they stay those of the place before, for a velocity
// that is to be projected and no more; M and the rows are those of q.
bool project_position(const Program& p, Workspace& w, double t, VecX& q, const VecX& v, bool configured = false,
                      bool keeps_factors = false);
// Closes what rows that count as dependent have left open: active rows that become short over a step magnify what the
// others miss. Of all rows those that are longest there are projected on, as many as before, for off the constraints
// dependent rows look independent.
bool project_onto_dependent(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);
// Closes what rows that count as dependent have left open, where elements stick: these hold them by too small a part of
// their forces to be kept (rank_tolerance_sticking), and creep by as little.
bool project_past_sticking(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);
// Moves v; the workspace must be configured at (t, q).
bool project_velocity(const Program& p, Workspace& w, double t, VecX& v);
// Whether both keep to the rows in use as they are, rows that count as dependent among them, of a state that moves too
// slowly to leave them by more than rounding over a step; no factors are taken. What sticks alone has exactly no velocity
// then.
bool keeps_to_rows(const Program& p, Workspace& w, double t, const VecX& q, VecX& v);
// Whether both are on the constraints as they are, as projecting would find them; rows and rates are evaluated, and no
// factors taken.
bool is_on_constraints(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Moves both, and leaves the workspace configured there.
bool project(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
// And evaluates them there.
void project_and_evaluate(const Program& p, Workspace& w, double t, VecX& q, VecX& v);

// Remove the part of a small change of the velocity, or of a small move, that a projection removes, by the factors in the
// workspace. Nonholonomic rows bind velocities only: no projection puts a position back along them.
void remove_normal_velocity(const Program& p, Workspace& w, Eigen::Ref<VecX> change);
void remove_normal_move(const Program& p, Workspace& w, Eigen::Ref<VecX> move);

// Chooses rows where no step has, at a state near the constraints, and moves its position onto them. The workspace must be
// configured there.
void choose_rows_near(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);

// Where no step has left factors: those of the state itself serve, with the rows that are independent there, all elements
// slipping.
void project_anew(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
// Does so unless the largest residual is beyond `far`; residual before and after, and the largest rate.
struct Closure { double before, after, rate; };
Closure close(const Program& p, Workspace& w, double t, VecX& q, VecX& v, double far);

// Largest residual of a block, as last evaluated, that is beyond what is allowed of rows of length one; zero where none is.
double opening(const Program& p, const Workspace& w, int block, double allowed);
// Length, in the metric of M, of the move that closed the position last.
double closing_distance(const Program& p, Workspace& w);
// Throws where a row's residual, as last evaluated, is open.
void require_closed(const Program& p, const Workspace& w, double t);

// Size of the scene: the largest distance of a body that the constraints touch from the world's origin, at least 1 m.
double scene_size(const Program& p, const Workspace& w);

}  // namespace pn
