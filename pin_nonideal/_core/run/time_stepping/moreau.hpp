// Time stepping at velocity level (Moreau's midpoint rule). With the slip velocities u at the step's end and the
// percussions P,
//     M (v1 - v0) = h (F + C) + A^T P + N^T P_f,   A v1 + phi_t = 0.
// P_f opposes u within h times its limit. The scheme has order 1 and no creep: sticking elements have zero velocity.
// All elements are solved together in every step.
#pragma once

#include <vector>

#include "complementarity/box_lcp.hpp"
#include "complementarity/friction_limits.hpp"
#include "friction/problem.hpp"
#include "run/integrators/system.hpp"

namespace pn {

// Set the right-hand sides b that satisfy the constraints at the end of a step of length h. The rows are evaluated at
// the middle of the step, so half of their own change is still to come.
void meet_at_end(const Program& p, const Evaluation& now, double h, VecX& b);

class Moreau {
public:
    explicit Moreau(System& system);

    // Take one step of size h from y at t. The energy added by the scheme itself is added to moved_energy. The modes
    // are set for the step's end. The caller must project and evaluate the end.
    void step(double t, double h, VecX& y, double& moved_energy);

private:
    void solve_without_friction(double t);
    void pose_problem();
    void solve_friction(double t);
    void apply_forces();
    double update_limits(double t);
    void end_velocity();
    void book_work(VecX& y, double& moved_energy);

    System& system_;
    const Program& p;
    Workspace& w;
    FrictionProblem problem_;  // problem of all elements
    std::vector<Mode> modes_, unloaded_;
    double h_ = 0.0;
    VecX q_mid_, v0_, v1_, move_, b_, a_free_, lam_free_;  // free: without friction of the elements
    VecX a_friction_, alpha_, near_;
    BoxProgram box_;
    bool boxes_ = true;  // every element has one direction
    VecX force_, power_;                  // forces and powers of the elements
    FrictionLimits limit_, force_limit_;  // current limits, and the limits for which the force was found
    bool even_ = true;                    // all limits are equal forward and backward
    VecX shifted_;
};

}  // namespace pn
