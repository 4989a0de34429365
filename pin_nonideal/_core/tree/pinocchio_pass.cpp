#include "tree/pinocchio_pass.hpp"

#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/jacobian.hpp>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/algorithm/rnea.hpp>

namespace pn {

namespace {

using Model = pinocchio::Model;
using Vector = Eigen::Ref<const VecX>;  // argument type that the wheel's libraries are compiled for

const Model& model_of(const Mechanism& m) { return *static_cast<const Model*>(m.model.get()); }

Motion motion(const pinocchio::Motion& x) { return {x.linear(), x.angular()}; }

}  // namespace

// A model of one joint, evaluated by `forwardKinematics`, which Pinocchio's library instantiates. The templates of the
// joint itself (createData, calc) take fifteen seconds to compile.
class SingleJoint {
public:
    explicit SingleJoint(const pinocchio::JointModel& joint) : model_(with(joint)), data_(model_) {}

    // Compute placement, motion subspace and bias at a configuration (nq) and velocity (nv) of this joint.
    const pinocchio::JointData& move(const Eigen::Ref<const VecX>& q, const Eigen::Ref<const VecX>& v) {
        pinocchio::forwardKinematics(model_, data_, q, v);
        return data_.joints[1];
    }
    const pinocchio::Model& model() const { return model_; }

private:
    static pinocchio::Model with(const pinocchio::JointModel& joint) {
        pinocchio::Model model;
        model.addJoint(0, joint, pinocchio::SE3::Identity(), "joint");
        return model;
    }

    pinocchio::Model model_;
    pinocchio::Data data_;
};

namespace {

// Compute the placement of a body from Pinocchio's placement about the world's origin.
void place(const Mechanism& m, const pinocchio::Data& data, int i, Body& b) {
    b.R = data.oMi[i].rotation();
    b.ref = data.oMi[m.joints[i].reference].translation();
    b.p = Vec3(data.oMi[i].translation()) - b.ref;
}

// Call act(k, column) with each column of a joint's motion subspace in place, without a copy on the heap.
template <class Act>
void each_column(const Model::JointData& joint, const Act& act) {
    boost::apply_visitor([&](const auto& kind) {
        const auto& S = kind.S_accessor().matrix();
        for (int k = 0; k < S.cols(); ++k)
            act(k, Motion{S.col(k).template head<3>(), S.col(k).template tail<3>()});
    }, joint.toVariant());
}

// Compute shift, inertia and columns of a body in a deep tree, about its own reference point.
void place_deep(const pinocchio::Data& data, BodyTerms& terms, const Joint& j, size_t i) {
    Body& b = terms.body[i];
    terms.deep.shift[i] = terms.body[j.parent].R * Vec3(data.liMi[i].translation());
    b.inertia = in_world(b, j.mass, j.com, j.inertia);
    each_column(data.joints[i], [&](int k, const Motion& column) { terms.J[j.iv + k] = in_world(b, column); });
}

}  // namespace

struct PinocchioJoints::Data {
    std::vector<std::unique_ptr<SingleJoint>> joints;  // per joint, null if the core has a formula
};

PinocchioJoints::PinocchioJoints() = default;
PinocchioJoints::PinocchioJoints(PinocchioJoints&&) noexcept = default;
PinocchioJoints::~PinocchioJoints() = default;

PinocchioJoints::PinocchioJoints(const Mechanism& m) : data_(new Data) {
    data_->joints.resize(m.joints.size());
    for (size_t i = 1; i < m.joints.size(); ++i)
        if (m.joints[i].kind == JointKind::other)
            data_->joints[i] = std::make_unique<SingleJoint>(model_of(m).joints[i]);
}

void PinocchioJoints::evaluate(const Mechanism& m, int i, const VecX& q, const VecX& v, JointMotion& out) {
    SingleJoint& joint = *data_->joints[i];
    const pinocchio::JointData& data =
        joint.move(q.segment(m.joints[i].iq, joint.model().nq), v.segment(m.joints[i].iv, joint.model().nv));
    const auto placement = pinocchio::joint_transform(data);
    out.R = placement.rotation();
    out.p = placement.translation();
    each_column(data, [&](int k, const Motion& column) { out.S[k] = column; });
    out.bias = motion(pinocchio::bias(data));
}

Motion first_motion(const void* model, int joint) {
    SingleJoint lone(static_cast<const Model*>(model)->joints[joint]);
    const VecX rest = VecX::Zero(lone.model().nv);
    Motion first;
    each_column(lone.move(pinocchio::neutral(lone.model()), rest), [&](int k, const Motion& column) {
        if (k == 0) first = column;
    });
    return first;
}

struct PinocchioPass::Data {
    std::shared_ptr<const void> owner;
    const Model& model;
    pinocchio::Data data;
};

PinocchioPass::PinocchioPass(PinocchioPass&&) noexcept = default;
PinocchioPass::~PinocchioPass() = default;

PinocchioPass::PinocchioPass(const Mechanism& m)
    : data_(new Data{m.model, model_of(m), pinocchio::Data(model_of(m))}) {
    // Free the second derivatives, which take memory with the cube of nv and are not used.
    pinocchio::Data& d = data_->data;
    for (auto* tensor : {&d.kinematic_hessians, &d.d2tau_dqdq, &d.d2tau_dvdv, &d.d2tau_dqdv, &d.d2tau_dadq})
        tensor->resize(0, 0, 0);
}

void place_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms, const std::vector<int>& joints,
                  const std::vector<Angle>&) {
    auto& [owner, model, data] = pass.data();
    pinocchio::forwardKinematics(model, data, Vector(terms.q));  // oMi
    for (int i : joints) place(m, data, i, terms.body[i]);
}

void place_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms) {
    auto& [owner, model, data] = pass.data();
    pinocchio::computeJointJacobians(model, data, Vector(terms.q));  // oMi, J
    for (size_t i = 1; i < m.joints.size(); ++i) {
        const Joint& j = m.joints[i];
        Body& b = terms.body[i];
        place(m, data, static_cast<int>(i), b);
        if (j.deep) {
            place_deep(data, terms, j, i);
            continue;
        }
        for (int dof = j.iv; dof < j.iv + j.nv; ++dof) {
            const Vec3 lin = data.J.col(dof).head<3>(), ang = data.J.col(dof).tail<3>();
            terms.J[dof] = {lin + ang.cross(b.ref), ang};
        }
    }
}

void move_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms, const VecX& v) {
    auto& [owner, model, data] = pass.data();
    pinocchio::nonLinearEffects(model, data, Vector(terms.q), Vector(v));  // v, a_gf, f, nle
    for (size_t i = 1; i < m.joints.size(); ++i) {
        Body& b = terms.body[i];
        b.v = in_world(b, motion(data.v[i]));
        b.a = in_world(b, motion(data.a_gf[i]));
    }
}

void mass_matrix(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms) {
    if (static_cast<int>(m.deep_dofs.size()) == m.nv) return;
    auto& [owner, model, data] = pass.data();
    // Local axes: about the world's origin a robot far away would lose digits.
    pinocchio::crba(model, data, Vector(terms.q), pinocchio::Convention::LOCAL);  // M, Ycrb
    for (size_t i = 1; i < m.joints.size(); ++i) {
        const Joint& j = m.joints[i];
        if (j.deep) continue;
        Body& b = terms.body[i];
        const auto& Y = data.Ycrb[i];
        b.Y = in_world(b, Y.mass(), Y.lever(), Y.inertia().matrix());
        for (int dof = j.iv; dof < j.iv + j.nv; ++dof) {
            terms.Ag[dof] = b.Y * terms.J[dof];
            double* row = terms.M.data() + m.row_offset[dof];
            const int* up = m.ancestors.data() + m.row_offset[dof];
            for (int s = 0; s <= m.depth[dof]; ++s) row[s] = data.M(up[s], dof);  // M of Eq. (1)
        }
    }
}

void bias_forces(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms) {
    const pinocchio::Data& data = pass.data().data;
    terms.nle = data.nle;  // in F of Eq. (1)
    for (size_t i = 1; i < m.joints.size(); ++i) {
        Body& b = terms.body[i];
        b.f.lin = b.R * Vec3(data.f[i].linear());
        b.f.ang = b.R * Vec3(data.f[i].angular()) + b.p.cross(b.f.lin);
        if (m.joints[i].deep) terms.deep.bias[i] = bias_force(b);
    }
}

}  // namespace pn
