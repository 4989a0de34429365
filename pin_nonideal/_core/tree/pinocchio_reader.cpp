#include "tree/pinocchio_reader.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include <boost/python.hpp>
#include <pinocchio/multibody.hpp>

#include "tree/pinocchio_pass.hpp"

namespace pn {

namespace {

using Model = pinocchio::Model;
using Composite = pinocchio::JointModelComposite;

int unit_axis(const Vec3& a) {
    for (int k = 0; k < 3; ++k)
        if (std::abs(a[k]) == 1.0) return k;
    return -1;
}

// Set kind and axis of a joint from Pinocchio's name for its type.
void classify(const Model& model, int i, Joint& out) {
    const std::string name = model.joints[i].shortname();
    auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
    if (has("Composite") || has("Mimic") || has("Universal") || has("ZYX") || has("Ellipsoid")) return;
    if (has("FreeFlyer")) { out.kind = JointKind::free_flyer; return; }
    if (has("Spherical")) { out.kind = JointKind::spherical; return; }
    if (has("Planar")) { out.kind = JointKind::planar; return; }
    if (has("Translation")) { out.kind = JointKind::translation; return; }
    const bool revolute = has("JointModelR"), prismatic = has("JointModelP"), helical = has("JointModelH");
    if (!revolute && !prismatic && !helical) return;
    // One dof with a constant motion subspace: read axis and pitch from it.
    const auto [lin, ang] = first_motion(&model, i);
    out.unbounded = model.joints[i].nq() == 2;
    if (prismatic) {
        out.kind = JointKind::prismatic;
        out.axis = lin;
    } else {
        out.kind = helical ? JointKind::helical : JointKind::revolute;
        out.axis = ang;
        out.pitch = lin.dot(ang);
    }
    out.axis_index = unit_axis(out.axis);
    if (out.axis_index >= 0) out.axis_sign = out.axis[out.axis_index];
}

// Dofs in one chain from which a tree is deep. The rows of M and its factor take time with the square and the cube of
// that number and lose digits with its fourth power. Sweeps by bodies (tree/articulated.hpp) are as fast from 25 dofs
// on without constraints, from 34 with three rows through all dofs and from 43 with six.
constexpr int deep_from = 40;

bool slides(const Joint& j) { return j.kind == JointKind::prismatic || j.kind == JointKind::translation; }

const Composite* composite(const Model::JointModel& joint) { return boost::get<Composite>(&joint.toVariant()); }

// Throw for joints with a motion that no provider computes, also inside composites.
void require_motion(const Model::JointModel& joint, const std::string& name) {
    if (joint.shortname().find("Mimic") != std::string::npos)
        throw std::invalid_argument("joint \"" + name + "\" is a mimic joint of Pinocchio; build the " +
                                    "model with mimic=False and add a JointCoupling instead");
    const Composite* parts = composite(joint);
    if (!parts) return;
    if (parts->joints.empty())
        throw std::invalid_argument("joint \"" + name + "\" is a composite without joints; add joints to it, or append " +
                                    "its body to the parent's joint");
    for (const auto& part : parts->joints) require_motion(part, name);
}

void add_charts(const Model::JointModel& joint, std::vector<Chart>& charts) {
    const std::string name = joint.shortname();
    auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
    const int iq = joint.idx_q(), iv = joint.idx_v(), nq = joint.nq(), nv = joint.nv();
    if (const Composite* parts = composite(joint)) {
        for (const auto& part : parts->joints) add_charts(part, charts);
    } else if (nq == nv) {
        Chart* last = charts.empty() ? nullptr : &charts.back();
        if (last && last->kind == Chart::Kind::vector && last->iq + last->n == iq && last->iv + last->n == iv)
            last->n += nv;  // extend the vector segment
        else
            charts.push_back({Chart::Kind::vector, iq, iv, nv});
    } else if (has("FreeFlyer")) {
        charts.push_back({Chart::Kind::pose, iq, iv, 0});
    } else if (has("Spherical")) {
        charts.push_back({Chart::Kind::quaternion, iq, iv, 0});
    } else if (has("Planar")) {
        charts.push_back({Chart::Kind::plane, iq, iv, 0});
    } else if (nq == 2 && nv == 1) {
        charts.push_back({Chart::Kind::circle, iq, iv, 0});
    } else {
        throw std::invalid_argument("joints of kind " + name + " are not supported");
    }
}

// Read the parameters of a joint and of its body.
Joint read_joint(const Model& model, int i) {
    const auto& joint = model.joints[i];
    Joint j;
    j.name = model.names[i];
    j.parent = static_cast<int>(model.parents[i]);
    j.iq = joint.idx_q();
    j.iv = joint.idx_v();
    j.nv = joint.nv();
    j.R0 = model.jointPlacements[i].rotation();
    j.aligned = model.jointPlacements[i].rotation() == Eigen::Matrix3d::Identity();
    j.p0 = model.jointPlacements[i].translation();
    classify(model, i, j);
    const auto& Y = model.inertias[i];
    j.mass = Y.mass();
    j.com = Y.lever();
    j.inertia = Y.inertia().matrix();
    return j;
}

// Find the root of joint i's tree. The tree's reference point moves to joint i if this joint turns and all joints
// before it slide.
void find_reference(std::vector<Joint>& joints, int i) {
    Joint& j = joints[i];
    j.root = j.parent == 0 ? i : joints[j.parent].root;
    j.reference = joints[j.root].reference;
    if (j.root == i) j.reference = i;
    j.recenters = j.root != i && !slides(j);
    for (int k = j.root; k < i && j.recenters; ++k) j.recenters = joints[k].root != j.root || slides(joints[k]);
    if (!j.recenters) return;
    for (int k = j.root; k <= i; ++k)
        if (joints[k].root == j.root) joints[k].reference = i;
}

// Find the parent of each dof on the path to the root.
void order_dofs(Mechanism& m) {
    for (std::vector<int>* list : {&m.dof_parent, &m.depth, &m.dof_joint}) list->resize(m.nv);
    for (size_t i = 1; i < m.joints.size(); ++i) {
        const Joint& j = m.joints[i];
        for (int dof = j.iv; dof < j.iv + j.nv; ++dof) {
            m.dof_joint[dof] = static_cast<int>(i);
            // The parent of a joint's first dof is the last dof of the parent joint.
            const Joint& before = m.joints[j.parent];
            const int parent = dof > j.iv ? dof - 1 : j.parent == 0 ? -1 : before.iv + before.nv - 1;
            m.dof_parent[dof] = parent;
            m.depth[dof] = parent < 0 ? 0 : m.depth[parent] + 1;
        }
    }
}

// Mark the deep trees, in which each joint is its own reference.
void find_deep_trees(Mechanism& m) {
    std::vector<char> deep(m.joints.size(), 0);  // by root
    for (int dof = 0; dof < m.nv; ++dof)
        if (m.depth[dof] + 1 >= deep_from) deep[m.joints[m.dof_joint[dof]].root] = 1;
    for (size_t i = 1; i < m.joints.size(); ++i) {
        Joint& j = m.joints[i];
        if (!deep[j.root]) continue;
        j.deep = true;
        j.recenters = false;
        j.reference = static_cast<int>(i);
        m.deep_joints.push_back(j.reference);
    }
    for (int dof = 0; dof < m.nv; ++dof) {
        m.is_deep.push_back(m.joints[m.dof_joint[dof]].deep);
        if (m.is_deep[dof]) m.deep_dofs.push_back(dof);
    }
}

// Set the units and levers of the dofs.
void measure_dofs(Mechanism& m) {
    std::vector<double> square(m.joints.size(), 0.0);  // by root
    for (const Joint& j : m.joints) {
        if (!(j.mass > 0.0)) continue;
        const double trace = j.inertia.c[0][0] + j.inertia.c[1][1] + j.inertia.c[2][2];
        square[j.root] = std::max(square[j.root], j.com.squaredNorm() + 0.5 * trace / j.mass);
    }
    m.unit.setOnes(m.nv);
    m.lever.setOnes(m.nv);
    for (int dof = 0; dof < m.nv; ++dof) {
        const Joint& j = m.joints[m.dof_joint[dof]];
        const int sliding = j.kind == JointKind::free_flyer ? 3 : j.kind == JointKind::planar ? 2 : 0;
        const double radius = square[j.root] > 0.0 ? std::sqrt(square[j.root]) : 1.0;
        (slides(j) || dof - j.iv < sliding ? m.unit : m.lever)[dof] = radius;
    }
}

void lay_out_rows(Mechanism& m) {
    for (int dof = 0; dof < m.nv; ++dof) {
        m.row_offset.push_back(m.row_entries);
        if (m.is_deep[dof]) continue;
        m.row_entries += m.depth[dof] + 1;
        for (int k = dof; k >= 0; k = m.dof_parent[k]) m.ancestors.push_back(k);
    }
}

// Check the numbers of the joints. Pinocchio's crba reads a subtree as one range of dofs. Therefore the parent of each
// joint must be the joint before it or one of its ancestors.
void require_branches(const Mechanism& m) {
    for (int i = 2; i < static_cast<int>(m.joints.size()); ++i) {
        const int parent = m.joints[i].parent;
        int before = i - 1;
        while (before > parent) before = m.joints[before].parent;
        if (before != parent)
            throw std::invalid_argument("terms=\"pinocchio\" needs joints numbered branch by branch, as Pinocchio's crba " +
                                        std::string("does; joint \"") + m.joints[i].name + "\" hangs on \"" +
                                        m.joints[parent].name + "\", which joint \"" + m.joints[i - 1].name +
                                        "\" does not move with; number them so, or take terms=\"core\"");
    }
}

// Compare bits, so that a NaN limit equals itself.
bool same(const double* x, const double* y, size_t n) { return std::memcmp(x, y, n * sizeof(double)) == 0; }

template <class Numbers>
bool same(const Eigen::MatrixBase<Numbers>& x, const Eigen::MatrixBase<Numbers>& y) {
    return x.size() == y.size() && same(x.derived().data(), y.derived().data(), x.size());
}

bool same(const Model::SE3& X, const Model::SE3& Y) {
    return same(X.translation(), Y.translation()) && same(X.rotation(), Y.rotation());
}

bool same(const Model::Inertia& X, const Model::Inertia& Y) {
    return X.mass() == Y.mass() && same(X.lever(), Y.lever()) && same(X.inertia().data(), Y.inertia().data());
}

bool same(const Model::Frame& X, const Model::Frame& Y) {
    return X.parentJoint == Y.parentJoint && same(X.placement, Y.placement) && X.name == Y.name;
}

template <class T>
bool all_same(const T& x, const T& y) {
    return std::equal(x.begin(), x.end(), y.begin(), y.end(), [](const auto& a, const auto& b) { return same(a, b); });
}

}  // namespace

Mechanism read_mechanism(const void* opaque, Provider provider) {
    auto model = std::make_shared<const Model>(*static_cast<const Model*>(opaque));
    Mechanism m;
    m.provider = provider;
    m.model = model;
    m.nq = model->nq;
    m.nv = model->nv;
    m.gravity = model->gravity.linear();
    m.armature = model->armature;
    m.joints.resize(model->njoints);
    m.joints[0].name = "universe";
    for (int i = 1; i < model->njoints; ++i) require_motion(model->joints[i], model->names[i]);
    for (int i = 1; i < model->njoints; ++i) {
        m.joints[i] = read_joint(*model, i);
        find_reference(m.joints, i);
        const Joint& j = m.joints[i];
        if ((j.kind == JointKind::revolute || j.kind == JointKind::helical) && !j.unbounded)
            m.angles.push_back({i, j.iq});
        add_charts(model->joints[i], m.charts);
    }
    order_dofs(m);
    find_deep_trees(m);
    measure_dofs(m);
    lay_out_rows(m);
    if (provider == Provider::pinocchio) require_branches(m);
    return m;
}

bool same_model(const void* one, const void* other) {
    const Model &a = *static_cast<const Model*>(one), &b = *static_cast<const Model*>(other);
    return a.njoints == b.njoints && a.parents == b.parents && a.names == b.names && a.joints == b.joints &&
           a.gravity == b.gravity && all_same(a.jointPlacements, b.jointPlacements) &&
           all_same(a.inertias, b.inertias) && all_same(a.frames, b.frames) && same(a.armature, b.armature) &&
           same(a.lowerPositionLimit, b.lowerPositionLimit) && same(a.upperPositionLimit, b.upperPositionLimit) &&
           same(a.lowerEffortLimit, b.lowerEffortLimit) && same(a.upperEffortLimit, b.upperEffortLimit) &&
           same(a.lowerVelocityLimit, b.lowerVelocityLimit) && same(a.upperVelocityLimit, b.upperVelocityLimit);
}

const void* model_pointer(_object* python_object) {
    boost::python::extract<const pinocchio::Model&> model(python_object);
    if (!model.check()) throw std::invalid_argument("expected a pinocchio.Model");
    return &model();
}

}  // namespace pn
