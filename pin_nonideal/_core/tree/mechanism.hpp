// The tree of joints and bodies as plain numbers, read once from a Pinocchio model.
//
// Every joint has one parent. The parent of a degree of freedom (dof) is the dof before it on the path to the root.
// M(q) and its factor are nonzero only if one dof is an ancestor of the other. Both are stored as one short row per
// dof: the entries of that dof with itself, its parent, its parent's parent, ... up to the root. Dofs of deep trees
// have no such rows (tree/articulated.hpp).
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
    bool deep = false;       // belongs to a deep tree: its body has its own reference point at the joint
    int reference = 0;       // joint of the tree's reference point: the first joint that rotates, or the root
    bool recenters = false;  // the reference point moves to this joint, which is not the root
    int iq = 0, iv = 0, nv = 0;
    Mat3 R0 = Mat3::Identity();  // placement in the parent joint's frame
    bool aligned = false;        // R0 is the identity
    Vec3 p0 = Vec3::Zero();
    Vec3 axis = Vec3::UnitZ();
    int axis_index = -1;  // 0, 1, 2 for x, y, z or their opposites, -1 for a general axis
    double axis_sign = 1.0;
    double pitch = 0.0;
    double mass = 0.0;
    Vec3 com = Vec3::Zero();
    Mat3 inertia;  // about the center of mass, in joint axes
    std::string name;
};

// Segment of the configuration with its Lie group, which relates its rate to the velocity.
struct Chart {
    enum class Kind { vector, circle, quaternion, plane, pose } kind = Kind::vector;
    int iq = 0, iv = 0, n = 0;  // n: length of a vector segment
};

struct Angle {  // a joint whose configuration is an angle, and its index in q
    int joint, iq;
};

enum class Provider { core, pinocchio };  // source of kinematics, M and the bias forces

struct Mechanism {
    Provider provider = Provider::core;
    std::vector<Joint> joints;  // joints[0] is the world
    std::vector<Angle> angles;  // all joints with an angle
    std::vector<Chart> charts;
    int nq = 0, nv = 0;
    Vec3 gravity = Vec3::Zero();
    VecX armature;
    // Radius of the tree: largest radius of gyration of its bodies about the axes of their joints, or 1 without one. Per
    // dof: displacement that compares with 1 rad (1 if the dof turns, the radius if it slides), and length of a unit
    // displacement (the radius if the dof turns, 1 if it slides).
    VecX unit, lever;
    std::vector<int> dof_parent, depth, row_offset;  // row of dof j: row_offset[j] + 0 .. depth[j]
    std::vector<int> dof_joint;  // joint that each dof belongs to
    std::vector<int> deep_joints, deep_dofs;  // joints and dofs of deep trees, each after its parent
    std::vector<char> is_deep;                // per dof
    std::vector<int> ancestors;  // dof of each entry of the rows
    int row_entries = 0;
    std::shared_ptr<const void> model;  // copy of the Pinocchio model, for quantities that only Pinocchio computes

    // Return the dofs that move the body of a joint, from the body to the root.
    std::vector<int> dofs_of(int joint) const;
};

}  // namespace pn
