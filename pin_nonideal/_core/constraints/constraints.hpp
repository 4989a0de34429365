// Rows of A(q, v, t) a = b(q, v, t), one small struct a kind.
//
// Most kinds act between two bodies: a row is then the power of a unit wrench w on the motion of body 1 relative to
// body 2, so that A_j = w . J_j, and the multiplier is the size of that wrench. The others act on dofs directly.
// Each kind reports, a row at a time: residual phi(q, t) (zero where there is none), rate = A v + phi_t, and
// drift = d(rate)/dt at zero acceleration, so that b = -drift.
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "tree/terms.hpp"
#include "math/timefunction.hpp"

namespace pn {

struct Frame {  // a frame fixed to the body of a joint (0: the world)
    int joint = 0;
    Mat3 R = Mat3::Identity();
    Vec3 p = Vec3::Zero();
};

struct PointRows {  // e . (x1 - x2) = 0 for axes e of frame 2
    Frame frame1, frame2;
    std::vector<int> axes;
};
struct ContactRow {  // height of a sphere's (or point's) center over the plane of frame 2 equals its radius
    Frame frame1, frame2;
    Vec3 normal;
    double radius;
};
struct FrameRows {  // origins and axes coincide
    Frame frame1, frame2;
};
struct HingeRows {  // origins coincide, and the axis of frame 1 with that of frame 2
    Frame frame1, frame2;
    Vec3 axis, normal1, normal2;  // right-handed, in both frames
};
struct DistanceRows {  // |x1 - x2| = length(t)
    Frame frame1, frame2;
    TimeFunction length;
};
struct KnifeRows {  // no velocity of the frame's origin along its axis
    Frame frame1, frame2;
    Vec3 axis;
};
struct RollingRows {  // a disk (or a sphere, without axle) rolls on the plane of frame 2 without slip
    Frame frame1, frame2;
    double radius;
    bool sphere;
    Vec3 axle;
    Vec3 tangent1, tangent2, normal;  // in frame 2
};
struct CouplingRows {  // q1 = ratio q2 + offset
    int joint1, joint2;
    double ratio, offset, period;  // period of the residual for joints that turn without end; 0: none
    bool position;                 // false: only the rate is bound
};
struct MotionRows {  // q_joint = f(t)
    int joint;
    TimeFunction function;
    double period;
};
struct UserRows {
    std::function<void(double t, const VecX& q, const VecX& v, MatX& A, VecX& b)> rows;
    std::function<void(double t, const VecX& q, VecX& phi)> residual;                // may be empty
    std::function<void(double t, const VecX& q, const VecX& v, VecX& rate)> rate;    // may be empty
};

// Directions of friction: what slips, as rows whose rate is the slip velocity.
struct DofRows {  // velocity of one dof or of the three of a ball joint
    int dof, count;
};
struct HingeSlipRows {  // turning about the common axis of a hinge anchor
    Frame frame1, frame2;
    Vec3 axis;
};
struct ContactSlipRows {  // sliding of the contact point along the plane of frame 2
    Frame frame1, frame2;
    double radius;
    Vec3 tangent1, tangent2, normal;
};
struct UserSlipRow {
    std::function<void(double t, const VecX& q, VecX& row)> direction;
};

using Kind = std::variant<PointRows, ContactRow, FrameRows, HingeRows, DistanceRows, KnifeRows, RollingRows, CouplingRows,
                          MotionRows, UserRows, DofRows, HingeSlipRows, ContactSlipRows, UserSlipRow>;

struct Wrench {  // force at a point of the world, and couple
    Vec3 force, point, couple;
};

// Rows of one constraint before any is left out.
struct RowValues {
    int rows = 0;
    bool geometric = false;  // rows are wrenches between joint1 and joint2
    std::vector<Wrench> wrench;
    std::vector<double> drift, residual, rate;
    std::vector<double> phi_t, phi_tt;  // explicit rates in time of the residual
    MatX A;  // rows x nv, when not geometric
    bool constant_A = false, has_A = false;  // A that never changes is written once
    VecX b, scratch;
    void resize(int n, int nv, bool is_geometric);
};

// What an evaluation of a kind may read.
struct State {
    const Mechanism& mechanism;
    const Terms& terms;
    double t;
    const VecX &q, &v;
};

// A constraint with its place among the rows of the scene.
struct Block {
    std::string name;
    Kind kind;
    int joint1 = 0, joint2 = 0;    // bodies of a geometric kind
    int total = 0;                 // rows of the description
    std::vector<int> kept;         // rows that act
    std::vector<char> holonomic;   // of the kept rows: has a residual
    bool comparable_rows = false;  // rows are components of one vector, of one unit
    int user_row = 0;              // first row in the user's numbering
    int row = 0;                   // first row among the kept rows of the scene
    int values = 0;                // place in Workspace::values
    std::vector<int> support;      // dofs that the scaled rows reach, descending and closed under ancestors
    std::vector<int> parent;       // place in support of each dof's parent, or -1
    struct Entry { int place, dof; double sign; };
    std::vector<Entry> entries;    // where A of a geometric kind may differ from zero
    int offset = 0;                // of its support.size() x kept.size() entries in Workspace::A and ::B
};

bool is_geometric(const Kind& kind);
const Frame* frame1(const Kind& kind);
const Frame* frame2(const Kind& kind);
bool has_constant_rows(const Kind& kind);
bool has_residual(const Kind& kind, int row);
// Whether its rate may differ from zero at zero velocity: it moves by itself.
bool moves_in_time(const Kind& kind);
int row_count(const Kind& kind, int user_size);

// What of all rows of the kind is evaluated: the residuals alone; residuals and wrenches or A, which bodies in their
// places give; or rates and drifts, which need bodies in motion, and the place part before.
enum class Part { gap, place, motion };
void evaluate(const Kind& kind, const State& s, Part part, RowValues& out);

// A on the block's support from the wrenches or the dense rows; dof-major.
void fill_A(const Block& block, const Terms& terms, const RowValues& values, double* A);
// B^T = D^-1/2 L^-T A^T on the block's support.
void scale_rows(const Mechanism& m, const Terms& terms, const Block& block, const double* A, double* B);

}  // namespace pn
