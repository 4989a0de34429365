// Time stepping at velocity level (Moreau's midpoint rule): with u the slip velocities at the step's end and P the
// percussions, M (v1 - v0) = h (F + C) + A^T P + N^T P_f, A v1 + phi_t = 0, and P_f opposes u within h times its limit.
// First order, and no creep: what sticks has no velocity at all. All elements are solved together in every step.
#pragma once

#include <vector>

#include "complementarity/box_lcp.hpp"
#include "complementarity/friction_limits.hpp"
#include "friction/problem.hpp"
#include "run/integrators/system.hpp"

namespace pn {

// Right-hand sides b by which constraints are met at the end of a step of length h, in whose middle they are evaluated:
// half of what their rows change by themselves is still to come.
void meet_at_end(const Program& p, const Evaluation& now, double h, VecX& b);

class Moreau {
public:
    explicit Moreau(System& system);

    // One step of size h from y at t; what the scheme itself adds to the energy goes into moved_energy. The modes are
    // those of the step's end, which is left to be projected and evaluated.
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
    FrictionProblem problem_;  // of all elements
    std::vector<Mode> modes_, unloaded_;
    double h_ = 0.0;
    VecX q_mid_, v0_, v1_, move_, b_, a_free_, lam_free_;  // free: without friction of the elements
    VecX a_friction_, alpha_, near_;
    BoxProgram box_;
    bool boxes_ = true;  // every element has one direction
    VecX force_, power_;                  // of the elements
    FrictionLimits limit_, force_limit_;  // the second: those that force was found for
    bool even_ = true;                    // all elements rub alike forward and backward
    VecX shifted_;
};

}  // namespace pn
