// Stick and slip. With the forces f of all elements at rest as unknowns, their slip accelerations are
// alpha = alpha0 + W f (problem.hpp). f opposes slip within its limits: |f| <= s, and f = -s alpha / |alpha| where alpha is
// not zero. For given limits this is a convex program in a box (a disk or ball for elements of several directions),
// solved for all elements at once; limits that depend on the load wrap it in an outer iteration.
#pragma once

#include "friction/slip_onset.hpp"

namespace pn {

// Slip slower than this part of the scene's speed is rest: rounding of the located event.
constexpr double rest_speed = 1e-11;
// Slip up to this part of it may be left where rows that stick are all but redundant: they raise rounding.
constexpr double raised_rest = 1e-9;

// By the slip velocities of the rows evaluated last: elements that stick or have come to rest (`also` among them), and
// the way the others go.
ModeQuestion question(const Program& p, Workspace& w, const VecX& v, int also = -1);
// At a start, where no mode is known: every element by its velocity. Updates the kinematics.
ModeQuestion first_question(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// An element that moves after all, as the rows evaluated last say, goes the way that they say.
void follow_velocity(const Program& p, Workspace& w, int element, ModeQuestion& question);

// Finds the modes of all elements at rest together; the workspace ends evaluated there with the new modes.
void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuestion& question);

// Whether an element is at rest at (q, v), as far as its slip speed tells (rows must be evaluated).
bool at_rest(const Program& p, const Workspace& w, int element, const VecX& v);

}  // namespace pn
