// Given forces F beside the bias, and the torques of the actuation, at one state.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// What is asked of the drives, whether they have that effort or not.
void asked_torque(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& tau);
// Given forces, and what the drives give, into w.now.external and w.now.tau.
void given_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
