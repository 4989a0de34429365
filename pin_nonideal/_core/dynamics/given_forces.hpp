// Given forces F beside the bias, and the torques of the actuation, at one state.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Given forces and actuation into w.now.tau and w.now.external.
void given_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
