// Evaluation of the forces of forces/given_forces.hpp and of actuation torques at one state.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Compute the commanded torques of the actuators, before effort limits.
void demanded_torque(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& tau);
// Compute the given forces and the torques within effort limits: w.now.external and w.now.tau.
void given_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
