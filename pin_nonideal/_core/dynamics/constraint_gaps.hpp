// Gaps that a projection leaves in the constraints, and the size of the scene to which they are relative.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Largest residual of a block, as last evaluated, above the allowed one for rows of unit length. Zero if there is none.
double opening(const Program& p, const Workspace& w, int block, double allowed);
// Length of the last closing move of the position, in the metric of M.
double closing_distance(const Program& p, Workspace& w);
// Throw a failure if the last evaluated residual of a row exceeds the allowed gap.
void require_closed(const Program& p, const Workspace& w, double t);

// Size of the scene [m]: largest distance of a constrained body from the world's origin, at least 1 m.
double scene_size(const Program& p, const Workspace& w);

}  // namespace pn
