// Step of time stepping at velocity level (Moreau's midpoint rule). With the slip velocities u at the step's end and the
// impulses P of constraints and P_f of friction and contacts,
//     q_m = q0 + h/2 v0,   M (v1 - v0) = h (F + C)(q_m, (v0 + v1)/2) + A^T P + N^T P_f,   q1 = q_m + h/2 v1,
//     A v1 + phi_t = 0,
// and friction opposes u within h times its limit. A contact takes part if its gap is closed at the step's middle. With
// the rate u_n- of its gap before the step, the restitution e and the impulse (P_n, P_t),
//     0 <= P_n,   0 <= u_n + e min(u_n-, 0),   one of them zero,     |P_t| <= mu P_n,
// and P_t opposes the slip velocity. These laws and the limits of the other friction elements form one cone problem. The
// scheme has order 2 between events and no creep: sticking elements have zero velocity.
#pragma once

#include <optional>
#include <vector>

#include "dynamics/failure.hpp"
#include "run/events/gap_watch.hpp"
#include "run/time_stepping/approaching_edges.hpp"
#include "run/time_stepping/contact_projection.hpp"
#include "run/time_stepping/free_flight.hpp"
#include "run/integrators/joint_drives.hpp"
#include "run/time_stepping/mean_velocity.hpp"
#include "run/time_stepping/opposed_contacts.hpp"
#include "run/time_stepping/step_forces.hpp"

namespace pn {

struct MoreauParameters {
    // Maximum number of passes for load-dependent limits.
    int max_load_passes = 60;
    // Change of limits without closed contacts that counts as rounding error if passes no longer reduce it, relative to the
    // largest force: loads of long chains have larger rounding errors.
    double stalled_limits = 1e-9;
    double width_rounding = 1e-12;  // uncertainty of a gap at rest, relative to the scene's size
};

class Moreau {
public:
    using Parameters = MoreauParameters;
    static constexpr Parameters parameters{};

    Moreau(System& system, GapWatch& watch, const ApproachingEdges& edges);

    // Discard the gaps and forces of earlier steps.
    void reset() {
        q_sampled_.resize(0);
        forces_.reset();
    }
    // Take one step of size h from y at t. The work of contacts along their normals is added to impact_energy. The
    // energy added by the scheme itself is added to numerical_energy. The modes are set for the step's end. The caller must
    // project and evaluate the end.
    void step(double t, double h, VecX& y, double& numerical_energy, double& impact_energy);
    // The next step is another attempt from the state of the last step: the loads before the first attempt count.
    void repeat() { repeats_ = true; }
    // Project the end y of the last step, at t, tree by tree. Return false if constraints join the trees: the caller
    // must then project the end onto all rows of the scene. Contacts that depart open in both cases.
    bool project(double t, VecX& y, double& numerical_energy);

    // Return the gaps that are open at the end y of the last step, per gap. Narrow open gaps may be missing.
    const std::vector<char>& open_gaps(const VecX& y);

    // Check if the last step was solved tree by tree.
    bool is_separate() const { return forces_.is_separate(); }
    // Contact whose laws the last step missed.
    const StepForces::LawMiss& law_miss() const { return forces_.law_miss(); }

private:
    void open_departing_contacts(double t, const VecX& y);
    void select(const std::vector<char>& closed, const std::vector<Mode>& modes, bool flies);
    void begin_sweeps(double t, JointDrives::Step& drives);
    void sweep(double t, JointDrives::Step& drives, bool first);
    std::optional<Failure> attempt_sweep(double t, JointDrives::Step& drives, bool first);
    bool correct(double t, JointDrives::Step& drives);
    void solve_free(double t);
    const VecX& path_since_last();
    void gather(double t);
    void find_touching(double t);
    void move_touching(double t);
    bool rest_within_limits(double t);
    bool find_forces(double t);
    void solve_forces(double t);
    void solve(double t);
    void begin_multipliers();
    void apply();
    void find_loaded();
    void keep_percussions();
    void end_velocity();
    void book_work(VecX& y, double& numerical_energy, double& impact_energy);

    System& system_;
    const Program& p;
    Workspace& w;
    MeanVelocity mean_;
    JointDrives drives_;
    FreeFlight flight_;
    OpposedContacts opposed_;
    double h_ = 0.0, t0_ = 0.0;  // length and start of the step
    VecX q0_;
    GapWatch& watch_;
    const ApproachingEdges& edges_;
    std::vector<int> touching_;  // gaps that take part, ascending
    StepElements elements_;
    StepForces forces_;
    std::vector<char> was_closed_, closed_, open_;
    std::vector<Mode> modes_, unloaded_;
    bool had_contacts_ = false;  // the last step had a closed contact or an active element
    bool has_unknown_percussions_ = true;  // other rows than these may have impulses
    std::vector<StepRow> rows_of_percussions_;
    std::vector<int> loaded_;  // blocks of the contacts with a load before the step, ascending
    bool repeats_ = false;     // the next step is another attempt
    VecX q_mid_, q_sampled_, v0_, v1_, a_free_, lam_free_, power_;
    ContactProjection projection_;
    VecX b_;
    VecX tangent_;  // move, travel or mean velocity of the step
};

}  // namespace pn
