// Out of what a step has entered where not all that is closed can lie on its plane: of a can that comes down tilted its
// rim and points of its face, of which the rim stands back.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// The longest of the moves, in the metric of M, that bring one of the closed contacts alone onto its plane.
double longest_single_move(const Program& p, const Workspace& w);
// Whether projection, from where that was the longest, has left some of them off their planes, or gone so far that they
// have planes which hardly differ.
bool strays_from_planes(const Program& p, Workspace& w, double longest_single);

// Moves q by the least move in the metric of M to where the constraints hold and no closed contact is inside its plane:
// gap >= 0, complementary to multipliers that press. Those that do not touch there are opened, and
// where no such place is found those that are off their planes where q was. Leaves the workspace configured at q, with the
// rows that are independent there; returns whether they were chosen.
bool move_out(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);

}  // namespace pn
