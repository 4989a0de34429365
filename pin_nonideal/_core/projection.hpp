// Back onto the constraints after a step: phi(q, t) = 0 by Newton's method and A v + phi_t = 0 by one solve, both in
// the metric of M, with the factors of the step's last evaluation.
#pragma once

#include "program.hpp"

namespace pn {

// Residuals below this part of the scene's size are rounding: a few hundred operations of unit roundoff.
constexpr double projection_floor = 2e-14;
constexpr int projection_limit = 12;
// A pivot of the rows' unit-diagonal factor below this is near a singular position: the square of the sine at which
// the nearest row stands to the others.
constexpr double near_singular = 2.5e-3;
// Where nothing can move, a velocity below this [rad/s or m/s] is what the last event left by rounding.
constexpr double immobile_speed = 1e-8;

// Moves q and v; returns false when nothing had to move. The workspace must hold factors near (t, q); afterwards its
// rows are those of the new state, its factors are not.
bool project(const Program& p, Workspace& w, double t, VecX& q, VecX& v);

// Size of the scene: the largest distance of a body from the world's origin, at least 1 m.
double scene_size(const Workspace& w);

}  // namespace pn
