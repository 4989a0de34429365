#include "tree/mechanism.hpp"

#include <algorithm>
#include <stdexcept>

#include <pinocchio/multibody.hpp>
#include <pinocchio/multibody/visitor.hpp>

namespace pn {

namespace {

using Model = pinocchio::Model;
using JointData = Model::JointData;

struct PinocchioJoints final : ForeignJoints {
    std::shared_ptr<const Model> model;
    std::vector<JointData> data;

    explicit PinocchioJoints(std::shared_ptr<const Model> m) : model(std::move(m)) {
        for (const auto& joint : model->joints) data.push_back(joint.createData());
    }

    void evaluate(int i, const VecX& q, const VecX& v, JointMotion& out) override {
        const auto& joint = model->joints[i];
        pinocchio::calc_first_order(joint, data[i], q, v);
        const auto M = pinocchio::joint_transform(data[i]);
        out.R = M.rotation();
        out.p = M.translation();
        out.nv = joint.nv();
        out.S.leftCols(out.nv) = pinocchio::joint_motin_subspace_xd(data[i]).matrix();
        const auto c = pinocchio::bias(data[i]);
        out.bias = {c.linear(), c.angular()};
    }
};

int unit_axis(const Vec3& a) {
    for (int k = 0; k < 3; ++k)
        if (std::abs(a[k]) == 1.0) return k;
    return -1;
}

// Kind and axis from the names that Pinocchio gives its joints.
void classify(const Model::JointModel& joint, const JointData& data, Joint& out) {
    const std::string name = joint.shortname();
    auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
    if (has("Composite") || has("Mimic") || has("Universal") || has("ZYX") || has("Ellipsoid")) return;
    if (has("FreeFlyer")) { out.kind = JointKind::free_flyer; return; }
    if (has("Spherical")) { out.kind = JointKind::spherical; return; }
    if (has("Planar")) { out.kind = JointKind::planar; return; }
    if (has("Translation")) { out.kind = JointKind::translation; return; }
    const bool revolute = has("JointModelR"), prismatic = has("JointModelP"), helical = has("JointModelH");
    if (!revolute && !prismatic && !helical) return;
    // One dof with a constant motion subspace: read axis and pitch from it.
    const auto S = pinocchio::joint_motin_subspace_xd(data).matrix();
    const Vec3 lin = S.col(0).head<3>(), ang = S.col(0).tail<3>();
    out.unbounded = joint.nq() == 2;
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

bool slides(const Joint& j) { return j.kind == JointKind::prismatic || j.kind == JointKind::translation; }

void add_charts(const Model::JointModel& joint, std::vector<Chart>& charts);

struct ChartsOfComposite : boost::static_visitor<bool> {
    std::vector<Chart>& charts;
    explicit ChartsOfComposite(std::vector<Chart>& c) : charts(c) {}
    template <class J>
    bool operator()(const J&) const { return false; }
    bool operator()(const pinocchio::JointModelComposite& composite) const {
        for (const auto& part : composite.joints) add_charts(part, charts);
        return true;
    }
};

void add_charts(const Model::JointModel& joint, std::vector<Chart>& charts) {
    const std::string name = joint.shortname();
    auto has = [&](const char* part) { return name.find(part) != std::string::npos; };
    const int iq = joint.idx_q(), iv = joint.idx_v(), nq = joint.nq(), nv = joint.nv();
    if (has("Composite")) {
        boost::apply_visitor(ChartsOfComposite(charts), joint.toVariant());
    } else if (nq == nv) {
        Chart* last = charts.empty() ? nullptr : &charts.back();
        if (last && last->kind == Chart::Kind::vector && last->iq + last->n == iq && last->iv + last->n == iv)
            last->n += nv;  // one stretch of vectors
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

}  // namespace

Mechanism read_mechanism(const void* opaque) {
    auto model = std::make_shared<const Model>(*static_cast<const Model*>(opaque));
    Mechanism m;
    m.model = model;
    m.nq = model->nq;
    m.nv = model->nv;
    m.gravity = model->gravity.linear();
    m.armature = model->armature;
    m.joints.resize(model->njoints);
    m.joints[0].name = "universe";
    m.dof_joint.resize(m.nv);
    m.dof_parent.resize(m.nv);
    m.depth.resize(m.nv);
    for (int i = 1; i < model->njoints; ++i) {
        const auto& joint = model->joints[i];
        if (joint.shortname().find("Mimic") != std::string::npos)
            throw std::invalid_argument("joint \"" + model->names[i] + "\" is a mimic joint of Pinocchio; build the " +
                                        "model with mimic=False and add a JointCoupling instead");
        auto data = joint.createData();
        const VecX q = pinocchio::neutral(*model), v = VecX::Zero(m.nv);
        pinocchio::calc_first_order(joint, data, q, v);
        Joint& j = m.joints[i];
        j.name = model->names[i];
        j.parent = static_cast<int>(model->parents[i]);
        j.root = j.parent == 0 ? i : m.joints[j.parent].root;
        j.iq = joint.idx_q();
        j.iv = joint.idx_v();
        j.nq = joint.nq();
        j.nv = joint.nv();
        j.R0 = model->jointPlacements[i].rotation();
        j.aligned = model->jointPlacements[i].rotation() == Eigen::Matrix3d::Identity();
        j.p0 = model->jointPlacements[i].translation();
        classify(joint, data, j);
        if ((j.kind == JointKind::revolute || j.kind == JointKind::helical) && !j.unbounded) m.angles.push_back({i, j.iq});
        m.has_foreign |= j.kind == JointKind::other;
        j.recenters = j.root != i && !slides(j);
        for (int k = j.root; k < i && j.recenters; ++k)
            j.recenters = m.joints[k].root != j.root || slides(m.joints[k]);
        const auto& Y = model->inertias[i];
        j.mass = Y.mass();
        j.com = Y.lever();
        j.inertia = Y.inertia().matrix();
        add_charts(joint, m.charts);
        for (int k = 0; k < j.nv; ++k) {
            const int dof = j.iv + k;
            m.dof_joint[dof] = i;
            int parent = dof - 1;
            if (k == 0) {  // last dof of the nearest ancestor that moves
                int p = j.parent;
                while (p != 0 && m.joints[p].nv == 0) p = m.joints[p].parent;
                parent = p == 0 ? -1 : m.joints[p].iv + m.joints[p].nv - 1;
            }
            m.dof_parent[dof] = parent;
            m.depth[dof] = parent < 0 ? 0 : m.depth[parent] + 1;
        }
    }
    for (int dof = 0; dof < m.nv; ++dof) {
        m.row_offset.push_back(m.row_entries);
        m.row_entries += m.depth[dof] + 1;
        for (int k = dof; k >= 0; k = m.dof_parent[k]) m.ancestors.push_back(k);
        m.max_depth = std::max(m.max_depth, m.depth[dof] + 1);
    }
    return m;
}

std::unique_ptr<ForeignJoints> Mechanism::make_foreign() const {
    if (!has_foreign) return nullptr;
    return std::make_unique<PinocchioJoints>(std::static_pointer_cast<const Model>(model));
}

std::vector<int> Mechanism::dofs_of(int joint) const {
    while (joint != 0 && joints[joint].nv == 0) joint = joints[joint].parent;
    std::vector<int> dofs;
    if (joint == 0) return dofs;
    for (int d = joints[joint].iv + joints[joint].nv - 1; d >= 0; d = dof_parent[d]) dofs.push_back(d);
    return dofs;
}

bool Mechanism::is_ancestor(int joint, int descendant) const {
    while (descendant > joint) descendant = joints[descendant].parent;
    return descendant == joint;
}

}  // namespace pn
