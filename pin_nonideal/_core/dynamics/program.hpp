// Program: the scene after its analysis, immutable and shared by threads.
// Workspace: every buffer of an evaluation, one per thread.
#pragma once

#include <functional>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

#include "constraints/equation.hpp"
#include "friction/laws.hpp"

namespace pn {

// Why an evaluation or a run cannot go on; turned into the package's exceptions at the door.
struct Failure : std::runtime_error {
    enum class Kind { singular_mass, inconsistent, not_finite, paradox, closure, step_size, interrupted };
    Kind kind;
    double time = 0.0;
    std::vector<int> elements;  // dofs, blocks or frictions, as the kind says
    double value = 0.0;         // residual, gap or determinant
    Failure(Kind k, double t, std::vector<int> e = {}, double x = 0.0)
        : std::runtime_error(encode(k, t, e, x)), kind(k), time(t), elements(std::move(e)), value(x) {}
    static std::string encode(Kind k, double t, const std::vector<int>& e, double x);
};

struct SpringDamper {
    Frame frame1, frame2;
    double stiffness = 0.0, damping = 0.0, rest_length = 0.0;
};
struct JointSpring {
    int joint = 0;
    double stiffness = 0.0, rest = 0.0, damping = 0.0;
};
struct FrameWrench {
    Frame frame;
    std::function<void(double t, double* six)> function;  // empty: constant
    double value[6] = {};
};
struct UserForce {
    std::function<void(double t, const VecX& q, const VecX& v, VecX& force)> function;
};
using GivenForce = std::variant<SpringDamper, JointSpring, FrameWrench, UserForce>;

struct NoActuation {};
struct ConstantTorque { VecX tau; };
struct TorqueFunction { std::function<void(double t, const VecX& q, const VecX& v, VecX& tau)> function; };
struct SampledTorque {
    std::function<void(double t, const VecX& q, const VecX& v, VecX& tau)> function;
    double period;
};
struct HoldPosition { VecX kp, kd, q; };
struct TorqueTable { std::vector<double> times; MatX values; };  // one column a time
using Actuation = std::variant<NoActuation, ConstantTorque, TorqueFunction, SampledTorque, HoldPosition, TorqueTable>;

struct Program {
    Mechanism mechanism;
    std::vector<Block> blocks;  // constraints first, then directions of friction
    int constraints = 0;        // number of constraint blocks
    std::vector<int> contacts;  // blocks of contacts, whose multiplier should press
    int user_rows = 0;          // rows of all constraint descriptions
    RowLayout layout;
    size_t entries = 0;         // of A and B

    std::vector<std::string> law_names;
    std::vector<Friction> frictions;
    std::vector<Viscous> viscous;
    std::vector<Drag> drags;
    std::vector<Sigmoid> sigmoids;
    std::vector<Bristle> bristles;
    std::vector<UserLaw> user_laws;
    int states = 0;  // of all laws

    std::vector<GivenForce> forces;
    Actuation actuation;

    // What the scene does not need is not computed.
    bool has_laws() const {
        return !frictions.empty() || !viscous.empty() || !drags.empty() || !sigmoids.empty() || !bristles.empty() ||
               !user_laws.empty();
    }
    bool needs_reactions = false;        // some law reads them
    bool needs_joint_reactions = false;  // of tree joints
    bool driven = false;                 // forces or actuation
    bool has_body_forces = false;        // given forces that act on bodies
    bool moves_in_time = false;          // some constraint moves by itself
    bool asks_functions = false;         // of the user's, for forces that may change while nothing moves
    bool affine_rates = true;            // A does not depend on v; a user's own rows may
    std::vector<int> touched_joints;     // whose bodies the constraints touch, and all before them in the tree
    std::vector<Angle> touched_angles;   // of these joints
    std::vector<int> touched_dofs;       // in the supports of the rows, ascending

    // Rows of constraints come first, rows of friction's directions after them.
    int constraint_rows() const {
        return constraints < static_cast<int>(blocks.size()) ? blocks[constraints].row : layout.rows;
    }

    // Numbers the kept rows, finds supports and lays out the storage; called again when rows are left out.
    void finish();
};

struct Counters {
    long evaluations = 0, factorizations = 0, projections = 0, iterations = 0;
};

struct Workspace {
    Terms terms;
    VecX tau, external, F, C, C_smooth, base_C, a;  // generalized forces and acceleration
    VecX scaled, scaled_free, trial, work;
    std::vector<RowValues> values;  // of each block
    std::vector<double> A, B;
    VecX b, r, miss, lam, lam_step, lam_shared;  // by kept row; shared: least norm among redundant rows
    RowSystem rows;
    RowSystem ideal_rows;  // of the constraints without what sticks; IdealMotion swaps them in
    std::vector<char> ideal_locked;
    bool ideal_decided = false;  // which of them are independent, over this step
    std::vector<Force> body_force, reaction_body;  // given forces; all external forces, then their subtree sums
    std::vector<Motion> motion;
    std::vector<Force> momentum;

    // Of the projection of a position: where its factors were taken, the multipliers from there and in all, those of
    // third order in the step, over its cube, and the steps that the multipliers took.
    VecX shift_start, shift, shift_sum, shift_third;
    std::vector<VecX> shift_steps;

    // Friction.
    std::vector<signed char> mode;    // +1, -1 slip, 0 stick
    std::vector<double> limit;        // kinetic, at the present load and slip speed
    std::vector<double> load;         // limit at rest before the static ratio
    bool indeterminate = false;       // what sticks shares its load in several ways: one multiplier says little
    // For elements of two or three directions: of the step's start, and where slip last had a clear direction.
    std::vector<Vec3> slip_direction, last_direction;
    double speed = 0.0;               // largest velocity of the evaluation
    VecX balance;                     // M a - F - C - A^T lam: what holds the locked dofs
    bool has_balance = false;
    std::vector<Vec3> slip_force;     // of each slipping element, along its directions
    std::vector<VecX> user_C;
    VecX z, dz;
    std::vector<VecX> law_force;  // C of each law, when asked for
    bool want_laws = false;

    VecX held_torque, override_torque;
    bool has_held = false, has_override = false;

    // What the implicit reaction equation last needed.
    VecX unknown, image, newton_step;
    MatX jacobian;
    bool warm = false;
    double determinant = 1.0;

    Counters counters;

    explicit Workspace(const Program& p);
};

// The heart: acceleration a and multipliers lam at (t, q, v) for the modes and active rows in the workspace.
void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The same after the state was put on the constraints.
void evaluate_on_constraints(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
// The part of it that the configuration decides: placements, M and the rows, with their factors. A user's own A may
// depend on v; where it does, a change of v has it taken anew.
void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v);
// Residuals of the constraints, and no more than they need.
void gaps(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Motion and rows at a state, rows, M's factor, rows in its metric.
void look_at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void evaluate_rows(const Program& p, Workspace& w, double t, const VecX& v);
void factor_mass(const Program& p, Workspace& w, double t);
void scale_rows(const Program& p, Workspace& w);
// a and lam for the given force F + C, by the factors in the workspace; refined where light bodies spoil them.
void solve_motion(const Program& p, Workspace& w, const VecX& force);
// Given forces and actuation into w.tau and w.external.
void given_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void actuation_torque(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& tau);

// Rows that must hold: constraints, and elements that stick elsewhere than in a joint (a joint that sticks is locked
// instead, which costs less than letting it move). All of them count as independent until begin_step.
void want_rows(const Program& p, Workspace& w);
// Evaluates at a step's start and decides which rows are independent here; contradicting rows are a failure.
void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// The same where the workspace is configured, after v was brought to A v + phi_t = 0; returns whether v moved.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v);

// Whether sticking elements and constraints leave no freedom at all: then nothing moves, exactly.
bool is_immobile(const Program& p, const Workspace& w);
// Forces that hold the locked dofs, for the motion in the workspace.
const VecX& holding_forces(const Program& p, Workspace& w);

// lam_shared from lam: redundant rows share the load with least norm (in the user's row scale).
void share_multipliers(const Program& p, Workspace& w);
// The motion of the ideal constraints: without C, and without what sticks. The workspace holds it, with its factors,
// while this object lives; then the factors are again those of the modes, and a and lam are left to the caller.
class IdealMotion {
public:
    IdealMotion(const Program& p, Workspace& w);
    ~IdealMotion();
    IdealMotion(const IdealMotion&) = delete;
    IdealMotion& operator=(const IdealMotion&) = delete;

private:
    const Program& p;
    Workspace& w;
    bool sticks = false;
};
struct Split {
    VecX F_ideal, F_nonideal, C, lam, lam_ideal;  // multipliers by row of the descriptions
};
// Eq. (39): ideal and nonideal part of the force of constraint at the state last evaluated.
void split_forces(const Program& p, Workspace& w, Split& out);

// Largest residual and rate over all rows of all descriptions at the state last evaluated.
void violations(const Program& p, const Workspace& w, double& position, double& velocity);

}  // namespace pn
