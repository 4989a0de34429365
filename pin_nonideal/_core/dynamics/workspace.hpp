// What a thread owns of a scene, split by who may rely on it: RunState lasts from step to step, Evaluation is what the
// last evaluation found, Scratch means nothing after the call that wrote it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>

#include "constraints/rank.hpp"
#include "dynamics/program.hpp"
#include "complementarity/fixed_point/equation.hpp"

namespace pn {

// Iterations of a projection, each of which keeps its multipliers; where Newton's method serves it takes three.
constexpr int projection_limit = 12;

struct Counters {
    long evaluations = 0, factorizations = 0, projections = 0, iterations = 0;
    double signorini = 0.0, coulomb = 0.0, dissipation = 0.0;  // largest misses of the laws of contact in time stepping
};

// Whether the motion is the only one that the laws allow; where functions of the user's are among them it is never shown.
enum class Uniqueness : signed char { shown, not_shown, several };
constexpr int never_decided = 1 << 30;

// What the next step needs of those before it, beside the state (q, v) itself and the choice of independent rows.
struct RunState {
    Modes mode;
    std::vector<char> closed;  // of each gap, to be changed by set_closed alone
    // For elements of two or three directions: of the step's start, and where slip last had a clear direction.
    std::vector<Vec3> slip_direction, last_direction;
    std::vector<char> lingers;  // slips on in its mode though it came to rest: rounding alone tells which way
    bool seeks_directions = false;  // steps find last_direction themselves: slip is too slow to tell it
    bool indeterminate = false;   // what sticks shares its load in several ways: one multiplier says little
    double rank_tolerance = rank_tolerance_sticking;  // of the rows while elements stick, in these modes
    VecX z;                       // states of laws, at the stage evaluated last
    VecX held_torque;             // of sampled control
    bool has_held = false;
    VecX unknown;                 // of the implicit reaction equation, by element and law: where its next solution starts
    bool warm = false;
    VecX percussion;              // of contacts and friction in the time step before, by row and over its length
    VecX third_order_lam;         // multipliers of third order in the step, over its cube
    bool ideal_decided = false;   // which rows are independent without what sticks, over this step
    Uniqueness unique = Uniqueness::shown;  // of the motion in these modes, as decided last
    double growth = 0.0;                    // bound on that of the implicit reaction equation there
    int steps_since = never_decided;        // then

    bool sticks_anywhere() const { return std::find(mode.begin(), mode.end(), sticking) != mode.end(); }
};

// What joints, anchors and contacts carry in the motion at hand (dynamics/reactions.hpp).
struct Reactions {
    bool current = false;  // made of that motion
    bool swept = false;    // through the joints of the tree as well
    bool presses = true;   // the loads of contacts that may open, redundant as they are, can all press
    // Contacts that may open and carry nothing, so that none that shares its load pulls. While it is held, loads are
    // linear in the motion, and may pull.
    std::vector<char> unloaded;
    bool holds_unloaded = false;
    VecX lam;              // by kept row; least norm among redundant rows
    std::vector<Force> body;  // external forces on each body, then their subtree sums
    std::vector<Motion> motion;
    std::vector<Force> momentum;
};

// What one evaluation at (t, q, v) yields.
struct Evaluation {
    Terms terms;
    bool frozen = false;  // functions of time stand still: rows have no accelerations of their own
    // Rows are evaluated in this stretch of time: at its ends, where functions of time break, as inside of it.
    double not_before = -HUGE_VAL, not_after = HUGE_VAL;
    void set_stretch(double begin, double end) {
        not_before = std::nextafter(begin, HUGE_VAL);
        not_after = std::nextafter(end, -HUGE_VAL);
    }
    double row_time(double t) const { return t < not_before ? not_before : t > not_after ? not_after : t; }
    std::vector<RowValues> values;  // of each block
    std::vector<char> idle;  // blocks of open contacts, which are no rows and are not evaluated
    std::vector<int> awake;              // the other blocks
    std::vector<int> touching;           // gaps that are closed
    std::vector<char> selected;          // the same by gap, as the rows were selected last
    std::vector<int> loaded, slipping;   // elements that rub, at rest or not; those that slip
    std::vector<double> A, B;
    RowSystem rows, ideal_rows;  // ideal: of the constraints without what sticks; IdealMotion swaps them in
    VecX b, lam;  // by kept row
    VecX closing_lam;  // multipliers of the move that closed the position last
    bool has_closing = false;  // they may differ from zero
    double projected_gap = 0.0, projected_rate = 0.0;  // largest residuals that projections met, over their rounding
    VecX tau, external, F, C, C_smooth, base_C, a;  // generalized forces and acceleration
    // F as the solution takes it, where trees are deep: their bias and the given forces on their bodies are wrenches.
    VecX joint_F, joint_external;
    std::vector<Force> wrench;
    Reactions reactions;
    VecX holding;                     // M a - F - C - A^T lam: what holds the locked dofs
    bool has_holding = false;
    bool ideal = false;               // the motion is that of the ideal constraints alone
    std::vector<SlipLimits> load;     // limits at rest before the static ratio
    std::vector<double> limit;        // kinetic, of each element
    std::vector<Vec3> slip_force;     // of each slipping element, along its directions
    std::vector<VecX> user_C;
    VecX dz;
    VecX v;                           // velocity, where laws act
    double speed = 0.0;               // largest of it
    bool several = false;             // what was at rest might slip as well as stick
    bool no_motion = false;           // the modes at the end of a step of time stepping allow none
    int several_element = 0;          // whose friction differs most between several motions, or leaves none
    double determinant = 1.0;         // of the implicit reaction equation
    std::vector<Force> body_force;    // given forces on bodies
    VecX override_torque;
    bool has_override = false;

    // What was derived from a motion no longer holds.
    void renew() { reactions.current = has_holding = false; }
};

struct Scratch {
    VecX scaled, scaled_free, trial, work, r, residual, lam_step;
    std::vector<char> ideal_locked;
    // Of the projection of a position: where its factors were taken, the multipliers from there, and the steps that they
    // took.
    VecX position_start, position_lam;
    std::vector<VecX> position_lam_steps;
    VecX unknown, image, shifted;  // of the implicit reaction equation
    VecX before, solution;
    ReactionEquation equation;
    ReactionNewton newton;
    MatX jacobian;
    std::vector<Force> subtree_force;
    std::vector<Force> body_inertia, body_residual;  // of refinement in deep trees
    std::vector<VecX> law_force;  // of each law, for its power
};

struct Workspace {
    RunState state;
    Evaluation now;
    Scratch scratch;
    Counters counters;
    bool continues = false;  // where several motions are possible: with the one nearest to the motion before

    explicit Workspace(const Program& p);
    Workspace(Workspace&&) noexcept;
    ~Workspace();
};

// Rows that must hold in these modes: constraints, closed gaps, and elements that stick elsewhere than in a joint (a
// joint that sticks is locked instead, which costs less than letting it move). All count as independent until a step
// begins.
void select_rows(const Program& p, Workspace& w);
// The one way to change modes: what hangs on them (rows that must hold, locked dofs, forces, reactions) follows.
void set_modes(const Program& p, Workspace& w, const std::vector<Mode>& modes);
// The same for contacts: friction of those that open ends, that of those that close has no mode yet.
void set_closed(const Program& p, Workspace& w, const std::vector<char>& closed);
// Both at once.
void set_contacts(const Program& p, Workspace& w, const std::vector<char>& closed, const std::vector<Mode>& modes);
// Of modes or flags.
template <class Byte>
bool same_bytes(const std::vector<Byte>& a, const std::vector<Byte>& b) {
    static_assert(sizeof(Byte) == 1);
    return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size()) == 0);
}
// Whether any contact that may open is closed.
inline bool any_closed(const RunState& state) {
    return !state.closed.empty() && std::memchr(state.closed.data(), 1, state.closed.size());
}
// Whether an element rubs at a contact that is open.
inline bool is_open(const Program& p, const Workspace& w, int element) {
    const int gap = p.frictions[element].gap;
    return gap >= 0 && !w.state.closed[gap];
}

}  // namespace pn
