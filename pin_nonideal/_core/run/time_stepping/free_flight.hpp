// Free rigid bodies in a time step: implicit midpoint rule with Cayley's map.
//
// With the inertia J about the center of mass, in body axes, and the moment tau of the given forces,
//     J (w1 - w0) + h wm x J wm = h tau,   wm = (w0 + w1) / 2,   R1 = R0 (I - h/2 [wm])^-1 (I + h/2 [wm]).
// Without forces the rotation keeps its energy and its momentum R J w exactly, for any step (J. C. Simo, K. K. Wong,
// "Unconditionally stable algorithms for rigid body dynamics that exactly preserve energy and momentum", Int. J. Numer.
// Meth. Engng. 31, 1991).
#pragma once

#include "run/integrators/joint_drives.hpp"

namespace pn {

struct FreeFlightParameters {
    int max_newton = 20;           // Newton steps for the angular velocity
    double turn_rounding = 1e-15;  // change that counts as rounding error, relative to the angular velocity
};

class FreeFlight {
public:
    using Parameters = FreeFlightParameters;
    static constexpr Parameters parameters{};

    FreeFlight(const Program& p, const JointDrives& drives);

    // Mark a body as not free in this step: a force of a contact or of dry friction acts on it.
    void begin();
    void touch(const Block& block);
    // Correct the velocity v1 of the free bodies at the end of a step of length h from (q0, v0). The forces come from
    // the evaluation in the workspace, at the velocity `mean`.
    void move(const Program& p, const Workspace& w, double h, const double* q0, const VecX& v0, const VecX& mean,
              VecX& v1);
    // Correct the configuration q1 of the bodies that `move` corrected.
    void place(const Program& p, double* q1) const;

private:
    struct Flight {
        int joint = 0, dof = 0;
        bool free = true;
        double q[7];  // configuration at the step's end
    };

    std::vector<Flight> flights_;
    std::vector<int> flight_;  // flight by its first dof, else -1
};

}  // namespace pn
