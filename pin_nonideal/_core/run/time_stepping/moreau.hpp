// Time stepping at velocity level (Moreau's midpoint rule): the scheme, and its step in scenes without unilateral
// contacts. moreau_contacts.hpp adds the contacts. With the slip velocities u at the step's end and the percussions P,
//     q_m = q0 + h/2 v0,   M (v1 - v0) = h (F + C)(q_m, (v0 + v1)/2) + A^T P + N^T P_f,   q1 = q_m + h/2 v1,
//     A v1 + phi_t = 0,
// and P_f opposes u within h times its limit. The scheme has order 2 between events and no creep: sticking elements have
// zero velocity. All friction elements are solved together.
#pragma once

#include <vector>

#include "complementarity/box_lcp.hpp"
#include "complementarity/friction_limits.hpp"
#include "friction/problem.hpp"
#include "math/anderson.hpp"
#include "run/integrators/system.hpp"
#include "run/time_stepping/free_flight.hpp"
#include "run/integrators/joint_drives.hpp"
#include "run/time_stepping/mean_velocity.hpp"
#include "run/time_stepping/shared_friction.hpp"

namespace pn {

struct MoreauParameters {
    double load_tolerance = 1e-13;  // change of limits that counts as rounding, relative to the largest limit
    // Change of limits that counts as rounding if a pass no longer halves it: loads of long chains have more
    // rounding.
    double stall_load_tolerance = 1e-9, min_load_decrease = 0.5;
    double limit_rounding = 1e-12;     // distance of a force at its limit, relative to the limit
    double slip_rest_rounding = 1e-9;  // slip at the end that counts as none, relative to that without friction
    // Maximum number of passes for load-dependent limits.
    int max_load_passes = 60;
};

class Moreau {
public:
    using Parameters = MoreauParameters;
    static constexpr Parameters parameters{};

    explicit Moreau(System& system);

    // Take one step of size h from y at t. The energy added by the scheme itself is added to numerical_energy. The modes
    // are set for the step's end. The caller must project and evaluate the end.
    void step(double t, double h, VecX& y, double& numerical_energy);

private:
    void sweep(double t, JointDrives::Step& drives, bool anew);
    void solve_without_friction(double t);
    void respond();
    void pose_problem();
    void unload_held();
    void drop_prevented_slip();
    void solve_friction(double t);
    bool find_forces(double t);
    void find_rest();
    bool give_way();
    bool is_within_limit(int e, int at);
    double slip_rounding() const;
    void find_dependent();
    void share_loads();
    void accelerate_limits();
    void apply_forces();
    double update_limits(double t);
    void end_velocity();
    void book_work(VecX& y, double& numerical_energy);

    System& system_;
    const Program& p;
    Workspace& w;
    FrictionProblem problem_;  // problem of all elements
    std::vector<Mode> modes_, unloaded_;
    std::vector<char> holds_;  // elements that static friction may hold
    double h_ = 0.0, t0_ = 0.0;  // length and start of the step
    VecX q0_;
    MeanVelocity mean_;
    JointDrives drives_;
    FreeFlight flight_;
    VecX q_mid_, v0_, v1_, move_, b_, a_free_, lam_free_;  // free: without friction of the elements
    VecX a_friction_, alpha_, initial_force_;
    BoxProgram box_;
    bool boxes_ = true;  // every element has one direction
    VecX force_, power_;                  // forces and powers of the elements
    FrictionLimits limit_, force_limit_;  // current limits, and the limits for which the force was found
    SharedFriction shared_;
    std::vector<int> all_rows_;
    bool are_dependent_ = false;    // some forces do not move the bodies: elements that stick share loads
    bool symmetric_limits_ = true;  // all limits are equal forward and backward
    AndersonAcceleration loads_;
    VecX shifted_;
};

}  // namespace pn
