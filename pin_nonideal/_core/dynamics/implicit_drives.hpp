// Springs, dampers and smooth friction of single dofs that a fixed step takes implicitly, with the stiffness K and the
// damping D:
//     M + theta h D + theta^2 h^2 K   in place of M,
//     F + D (v - v0) - (2 theta - 1) h K v0   in place of F at the velocity v.
// The force is thus evaluated at the fraction theta of the step. With theta = 1/2 the step is second order and keeps the
// energy of springs. A larger theta damps vibrations and fast decay that the step does not resolve.
#pragma once

#include "tree/terms.hpp"

namespace pn {

struct ImplicitDrives {
    bool active = false;
    double h = 0.0;
    VecX stiffness, damping;  // K and D per dof
    VecX theta, inertia;      // inertia: theta h D + theta^2 h^2 K
    VecX force;               // D (v - v0) - (2 theta - 1) h K v0

    // Choose theta and add the inertia to M.
    void add_inertia(const Mechanism& m, Terms& terms);
    // Set the force at the velocity v.
    void set_velocity(const VecX& v0, const VecX& v);
};

// Return theta for the spring and damper of one dof, in a step of length h.
double implicit_part(double h, double inertia, double stiffness, double damping);

}  // namespace pn
