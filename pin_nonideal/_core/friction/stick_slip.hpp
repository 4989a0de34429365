// Stick-slip modes. With the forces f of all elements at rest as unknowns, their slip accelerations are alpha = alpha0
// + W f (problem.hpp). Friction opposes slip within its limits: |f| <= s, and f = -s alpha / |alpha| if alpha is
// nonzero. For given limits this is a convex program in a box, or a disk or ball for elements of several directions.
// All elements are solved at once. An outer iteration updates load-dependent limits.
#pragma once

#include "friction/slip_onset.hpp"

namespace pn {

// Set up the mode problem from the slip velocities of the rows last evaluated. Elements at rest stick or have come to
// rest (`also` among them). Moving elements slip along their velocities.
ModeQuestion question(const Program& p, Workspace& w, const VecX& v, int also = -1);
// Set up the mode problem at a start, where no mode is known, from the velocity of every element. Updates the
// kinematics.
ModeQuestion first_question(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Set the mode of a moving element from its slip velocity in the rows last evaluated.
void follow_velocity(const Program& p, Workspace& w, int element, ModeQuestion& question);

// Compute the modes of all elements at rest. The workspace is evaluated with the new modes on return.
void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuestion& question);

// Check if an element sticks or has zero slip speed at (q, v), up to rounding. Rows must be evaluated.
bool at_rest(const Program& p, const Workspace& w, int element, const VecX& v);

}  // namespace pn
