// Workspace of one thread, split by lifetime. RunState lasts from step to step, Evaluation holds the last evaluation,
// and Scratch is valid only inside the call that wrote it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>

#include "constraints/rank.hpp"
#include "dynamics/implicit_drives.hpp"
#include "dynamics/law_force_list.hpp"
#include "dynamics/motion_forces.hpp"
#include "dynamics/program.hpp"
#include "dynamics/slip_forces.hpp"
#include "complementarity/fixed_point/equation.hpp"
#include "math/bytes.hpp"
#include "math/tolerances.hpp"
#include "tree/oblique_sweep.hpp"

namespace pn {

// Maximum number of iterations of a projection, each with stored multipliers. Newton's method takes three if it
// converges well.
constexpr int max_projection_iterations = 12;

// Rank tolerance of the rows while elements stick. Sticking elements do not resist motions along which they act with less
// than this fraction of their forces. The value is the square root of response_rank_threshold (complementarity/box_lcp.hpp),
// since a response is quadratic in the rows.
constexpr double rank_tolerance_sticking = 3e-7;

struct Counters {
    long evaluations = 0, factorizations = 0, projections = 0, iterations = 0;
    // Largest residuals of accepted motions: equation of motion, and laws of contact and friction.
    double motion = 0.0, signorini = 0.0, coulomb = 0.0, dissipation = 0.0;
};

// Uniqueness of the motion under the laws. Uniqueness is never proven if user functions are among the laws.
enum class Uniqueness : signed char { shown, not_shown, several };
constexpr int undecided_steps = 1 << 30;

// Rates of the velocity in the last steps of time stepping, latest first.
struct VelocityRates {
    static constexpr int most = 3;
    VecX rate[most];
    int count = 0;  // known rates
};

// Data that the next step needs from earlier steps, besides the state (q, v) and the choice of independent rows.
struct RunState {
    Modes mode;
    std::vector<char> closed;  // closed contacts, per gap (change them by set_closed only)
    // Slip directions of elements with two or three directions: at the step's start, and the last well-defined one.
    std::vector<Vec3> slip_direction, last_direction;
    std::vector<char> is_sticking_deferred;  // keeps its slip mode at rest: only rounding decides the direction
    bool solves_directions = false;  // steps solve for last_direction: slip is too slow to define it
    bool is_hyperstatic = false;   // multipliers of sticking elements are not unique
    double rank_tolerance = pn::rank_tolerance;  // tolerance of the rows in these modes
    VecX z;                       // states of laws, at the last evaluated stage
    VecX held_torque;             // torque of sampled control
    bool has_held = false;
    VecX unknown;                 // last solution of the implicit reaction equation, per element and law (warm start)
    bool warm = false;             // true if `unknown` is an initial guess for the next solution
    std::vector<Force> bearing_wrench;  // wrenches of joints in that solution, per element with a load in a tree
    bool has_wrenches = false;     // true if that solution was found by sweeps over trees
    VecX percussion;  // impulses of contacts and friction in the last time step, per row and divided by its length
    VelocityRates last_rates;
    VecX q_without_rest;  // configuration that no forces held at rest in earlier time steps, or empty
    VecX third_order_gap;         // third-order part of the gaps that a step closes, divided by its cubed length
    bool has_ideal_row_choice = false;   // rows that are independent without sticking elements are chosen for this step
    Uniqueness unique = Uniqueness::shown;  // uniqueness of the motion in these modes, as last decided
    // Bound on the largest eigenvalue of |dg/dy| of the implicit reaction equation at that decision.
    double spectral_bound = 0.0;
    int steps_since = undecided_steps;        // steps since that decision

    bool sticks_anywhere() const { return std::find(mode.begin(), mode.end(), sticking) != mode.end(); }
};

// Loads of joints, anchors and contacts in the current motion (dynamics/reactions.hpp).
struct Reactions {
    bool current = false;  // true if the loads are those of the current motion
    bool swept = false;    // true if joint reactions are computed too
    bool loads_are_feasible = true;   // all unilateral contacts with redundant loads can be in compression
    // Unilateral contacts with zero load, chosen so that no contact that shares their load has tension. While this set
    // is frozen, loads are linear in the motion, and tension is possible.
    std::vector<char> has_zero_load;
    bool is_zero_load_set_frozen = false;
    VecX lam;              // per kept row, minimum norm among redundant rows
    std::vector<Force> body;  // external forces on each body, later the sums of its subtree
    std::vector<Motion> motion;
    std::vector<Force> momentum;
};

// Results of one evaluation at (t, q, v).
struct Evaluation {
    Terms terms;
    bool frozen = false;  // true if functions of time are constant: rows have zero right-hand sides b
    // Time interval in which rows are evaluated. At its ends, where functions of time break, use the limits from
    // inside.
    double not_before = -HUGE_VAL, not_after = HUGE_VAL;
    void set_stretch(double begin, double end) {
        not_before = std::nextafter(begin, HUGE_VAL);
        not_after = std::nextafter(end, -HUGE_VAL);
    }
    double row_time(double t) const { return t < not_before ? not_before : t > not_after ? not_after : t; }
    BlockValues values;
    std::vector<char> is_inactive;  // blocks of open contacts, which are neither rows nor evaluated
    std::vector<int> active_blocks;              // the other blocks
    std::vector<int> closed_gaps;                // closed gaps
    std::vector<char> selected;                  // closed flags per gap, at the last selection of rows
    std::vector<int> loaded_elements, slipping;  // elements with load (sticking or slipping), and slipping elements
    RowEntries A, B;
    // Number of rows of constraints that depend on others, at the start of the last time step whose rows were chosen. A
    // negative value means that the number is not known.
    int dependent_at_start = -1;
    RowSystem rows, ideal_rows;  // ideal: of the constraints without sticking elements (see IdealMotion)
    VecX b, lam;  // per kept row
    VecX closing_lam;  // multipliers of the last closing move of the position
    VecX step_gap;     // negative residuals at the end of a step that follows the constraints, before projection
    bool awaits_gap = false;   // such a step has not been projected yet
    bool has_closing = false;  // closing_lam may be nonzero
    double projected_gap = 0.0, projected_rate = 0.0;  // largest residuals before projection, relative to rounding
    VecX tau, external, F, C, C_smooth, base_C, a;  // generalized forces and acceleration
    // F of the solution for deep trees: the bias and the given forces on their bodies are wrenches.
    VecX joint_F, joint_external;
    std::vector<Force> wrench;
    Reactions reactions;
    VecX holding;                     // M a - F - C - A^T lam: forces that hold the locked dofs
    bool has_holding = false;
    bool ideal = false;               // true if the motion is due to the ideal constraints alone
    std::vector<SlipLimits> load;     // limits at rest before the static ratio
    std::vector<double> limit;        // kinetic limit of each element
    SlipForces slip_force;            // force of each slipping element, along its directions
    std::vector<VecX> user_C;
    VecX dz;
    VecX v;                           // velocity, if laws act
    double speed = 0.0;               // largest component of v
    bool several = false;             // true if some element at rest may either slip or stick
    bool no_motion = false;           // true if no motion exists for the modes at the end of a time step
    int several_element = 0;          // element whose friction differs most between several motions, or that allows none
    std::vector<Force> body_force;    // given forces on bodies
    VecX override_torque;
    bool has_override = false;
    ImplicitDrives drives;            // springs, dampers and smooth friction that a fixed step takes implicitly

    // Invalidate the values derived from a motion.
    void renew() { reactions.current = has_holding = false; }
};

// Friction that follows the loads of tree joints, linearized (dynamics/loaded_trees.hpp).
struct LoadedJoint {
    const Friction* friction = nullptr;
    int joint = 0, dof = 0;
    double factor = 1.0;  // limit per load
    Vec3 axis, along;     // axis of the bearing, and direction of the friction force
    Force wrench;         // wrench of the joint about its origin
    Force beyond;         // part of the wrench that the reaction of the sweep does not contain, about the body's reference
    Motion gradient;      // derivative of the load by the wrench about the body's reference
    double rest = 0.0;    // load minus the gradient times the reaction of the sweep
};
struct LoadedJoints {
    std::vector<LoadedJoint> elements;
    ObliqueSweep sweep;
    VecX known, x;  // generalized forces independent of reactions, and forces or accelerations of the sweep
};

struct Scratch {
    RowValues passing_gap;  // a gap whose block has no storage
    VecX scaled, scaled_free, trial, work, r, residual, lam_step;
    std::vector<char> ideal_locked;
    // Projection of a position: state of the factorization, multipliers of the move from this state, and steps of the
    // multipliers.
    VecX position_start, position_lam;
    std::vector<VecX> position_lam_steps;
    VecX unknown, image, shifted;  // implicit reaction equation
    VecX before, solution;
    LoadedJoints loaded;           // friction that follows the loads of tree joints (dynamics/loaded_trees.hpp)
    ReactionEquation equation;
    ReactionNewton newton;
    // Unknowns of its factor, or 0 if no evaluation in these modes has one since the step began.
    int factored_unknowns = 0;
    MatX jacobian;
    std::vector<Force> subtree_force;
    std::vector<Force> body_inertia, body_residual;  // refinement in deep trees
    LawForceList law_force;       // C of each law, for its power
    MotionForces forces;          // forces of the motion whose laws are checked
    VecX law_weight, law_residual, law_magnitude;  // per dof
};

struct Workspace {
    RunState state;
    Evaluation now;
    Scratch scratch;
    Counters counters;
    bool continues = false;  // among several motions select the nearest to the previous motion
    std::function<void(double t)> watch;  // called every few evaluations, and may end the run by an exception

    explicit Workspace(const Program& p);
    Workspace(Workspace&&) noexcept;
    ~Workspace();
};

// Select the rows that must hold in these modes: constraints, closed gaps, and sticking elements outside of joints. A
// sticking joint is locked instead, which costs less than a free joint. All rows count as independent until a step
// begins.
void select_rows(const Program& p, Workspace& w);
// Change the modes and update all dependent data (required rows, locked dofs, forces, reactions). Change modes here
// only.
void set_modes(const Program& p, Workspace& w, const std::vector<Mode>& modes);
// Change the closed contacts. Friction elements of contacts that open or close become unloaded.
void set_closed(const Program& p, Workspace& w, const std::vector<char>& closed);
// Change closed contacts and modes.
void set_contacts(const Program& p, Workspace& w, const std::vector<char>& closed, const std::vector<Mode>& modes);
// Check if any unilateral contact is closed.
inline bool any_closed(const RunState& state) {
    return !state.closed.empty() && std::memchr(state.closed.data(), 1, state.closed.size());
}
// Check if a sticking element of single dofs locks these dofs, without rows.
inline bool is_locked(const Workspace& w, const Block& friction) {
    return friction.dof >= 0 && w.now.terms.locked[friction.dof];
}
// Check if an element belongs to an open contact.
inline bool is_open(const Program& p, const Workspace& w, int element) {
    const int gap = p.frictions[element].gap;
    return gap >= 0 && !w.state.closed[gap];
}

}  // namespace pn
