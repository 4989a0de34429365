// The tree of joints and bodies as plain numbers, read once from a Pinocchio model.
//
// Every joint hangs on one parent; each degree of freedom (dof) hangs on the dof before it on the way to the root.
// M(q) and its factor are nonzero only where one dof is an ancestor of the other, so both are stored as one short
// row per dof: the entries of that dof with itself, its parent, its parent's parent, ... up to the root.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "math/spatial.hpp"

namespace pn {

enum class JointKind { revolute, prismatic, helical, spherical, free_flyer, planar, translation, other };

struct Joint {
    JointKind kind = JointKind::other;
    bool unbounded = false;  // configuration is (cos, sin) of the angle
    int parent = 0, root = 0;
    bool recenters = false;  // first joint of its tree that turns: the tree's reference point moves here
    int iq = 0, iv = 0, nq = 0, nv = 0;
    Mat3 R0 = Mat3::Identity();  // placement in the parent joint's frame
    bool aligned = false;        // R0 is the identity
    Vec3 p0 = Vec3::Zero();
    Vec3 axis = Vec3::UnitZ();
    int axis_index = -1;  // 0, 1, 2 for x, y, z or their opposites; -1 for a general axis
    double axis_sign = 1.0;
    double pitch = 0.0;
    double mass = 0.0;
    Vec3 com = Vec3::Zero();
    Mat3 inertia;  // about the center of mass, in joint axes
    std::string name;
};

// How a stretch of the configuration moves with the velocity (Lie groups of the joints).
struct Chart {
    enum class Kind { vector, circle, quaternion, plane, pose } kind = Kind::vector;
    int iq = 0, iv = 0, n = 0;  // n: length of a vector stretch
};

struct JointMotion {  // what a joint of kind `other` reports: placement, motion subspace, bias
    Mat3 R;
    Vec3 p;
    int nv;
    Eigen::Matrix<double, 6, 6> S;
    Motion bias;
};

// Joints without a formula of our own (universal, composite, ...), evaluated by Pinocchio.
class ForeignJoints {
public:
    virtual ~ForeignJoints() = default;
    virtual void evaluate(int joint, const VecX& q, const VecX& v, JointMotion& out) = 0;
};

struct Angle {  // a joint whose configuration is an angle, and its place there
    int joint, iq;
};

struct Mechanism {
    std::vector<Joint> joints;  // joints[0] is the world
    std::vector<Angle> angles;  // of all joints that have one
    std::vector<Chart> charts;
    int nq = 0, nv = 0;
    Vec3 gravity = Vec3::Zero();
    VecX armature;
    std::vector<int> dof_joint, dof_parent, depth, row_offset;  // row of dof j: row_offset[j] + 0 .. depth[j]
    std::vector<int> ancestors;  // dof of each entry of the rows
    int row_entries = 0;
    bool has_foreign = false;
    int max_depth = 0;

    std::shared_ptr<const void> model;  // the copy of the pinocchio model behind `other` joints

    std::unique_ptr<ForeignJoints> make_foreign() const;
    // Dofs that move the body of a joint, from the body to the root.
    std::vector<int> dofs_of(int joint) const;
    bool is_ancestor(int joint, int descendant) const;  // true for equal joints as well
};

// Reads a pinocchio model (passed as `const pinocchio::Model*`).
Mechanism read_mechanism(const void* model);

// dq/dt in ambient coordinates (quaternions and cos/sin as plain numbers).
void configuration_rate(const Mechanism& m, const double* q, const double* v, double* dq);
// Unit length of quaternions and (cos, sin) restored.
void normalize(const Mechanism& m, double* q);
// Whether they have unit length, to this tolerance.
bool has_unit_lengths(const Mechanism& m, const double* q, double tolerance);
// Tangent coordinates of a small ambient change dq at q.
void ambient_to_tangent(const Mechanism& m, const double* q, const double* dq, double* tangent);
// q moved by the tangent vector w for unit time (exponential map).
void retract(const Mechanism& m, const double* q, const double* w, double* out);

}  // namespace pn
