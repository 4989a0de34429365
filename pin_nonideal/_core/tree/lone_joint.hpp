// One joint of a model by itself, moved by the functions that Pinocchio's library holds compiled: the joint's own
// templates would be compiled again in each source that calls them.
#pragma once

#include <pinocchio/algorithm/kinematics.hpp>
#include <pinocchio/multibody.hpp>

#include "math/spatial.hpp"

namespace pn {

class LoneJoint {
public:
    explicit LoneJoint(const pinocchio::JointModel& joint) : model_(with(joint)), data_(model_) {}

    // Placement, motion subspace and bias at a configuration (nq) and velocity (nv) of this joint.
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

}  // namespace pn
