// Stick and slip. With the forces f of all elements at rest as unknowns, their slip accelerations are
// alpha = alpha0 + W f, W the Delassus matrix of their directions after the constraints. f opposes slip within its
// limits: |f| <= s, and f = -s alpha / |alpha| where alpha is not zero. For given limits this is a convex program in a
// box (a disk or ball for elements of several directions), solved for all elements at once; limits that depend on the
// load wrap it in an outer iteration.
#pragma once

#include "dynamics/evaluation.hpp"

namespace pn {

// Slip slower than this part of the scene's speed is rest: rounding of the located event.
constexpr double rest_speed = 1e-11;

// Responses below this part of the largest are none; rank_tolerance_sticking is its square root.
constexpr double rank_threshold = 1e-13;

// min f^T W f / 2 + alpha0^T f with |f_e| <= s_e: f for elements whose directions lie one after the other (dims[e]
// rows each): a box for elements of one direction, disks and balls for the others.
VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& limits);
VecX ball_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& limits);

// Finds the modes of the candidate elements together, at rest along their directions; the workspace ends evaluated
// there with the new modes. `breaking` is a candidate that stuck until now and has just reached its limit: it slips
// as soon as its force is at the limit, though its acceleration is still zero; `any_at_limit` lets all do so that are.
constexpr int any_at_limit = -3;
void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                   const std::vector<int>& candidates, int breaking = -1);

// Friction force of an element in the evaluation at hand: the multiplier of what sticks, the law's force of what slips.
Vec3 friction_force(const Program& p, Workspace& w, int element);
// Largest force with which an element can stick now.
double static_limit(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);

// The mode of an element that moves, by the slip velocity of the rows evaluated last.
void follow_velocity(const Program& p, Workspace& w, int element);

// Elements at rest at (q, v), as far as their slip speeds tell (rows must be evaluated).
bool at_rest(const Program& p, const Workspace& w, int element, const VecX& v);

}  // namespace pn
