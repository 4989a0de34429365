// What Pinocchio computes, behind a door without its headers: the motion of joints that only it knows, and with
// terms="pinocchio" all of Terms. Nothing it holds lasts from one evaluation to the next.
#pragma once

#include <memory>
#include <vector>

#include "tree/body_terms.hpp"

namespace pn {

struct JointMotion {  // of a joint's moving frame: placement behind the joint, motion per dof and bias in its own axes
    Mat3 R;
    Vec3 p;
    std::vector<Motion> S;
    Motion bias;
};

// Joints of kind `other`, one by one.
class PinocchioJoints {
public:
    PinocchioJoints();
    explicit PinocchioJoints(const Mechanism& m);
    PinocchioJoints(PinocchioJoints&&) noexcept;
    ~PinocchioJoints();
    // `out.S` has room for the dofs of any of them.
    void evaluate(const Mechanism& m, int joint, const VecX& q, const VecX& v, JointMotion& out);

private:
    struct Data;
    std::unique_ptr<Data> data_;
};

// First column of the motion subspace of joint `joint` of a `pinocchio::Model`, in the joint's axes, at its neutral
// configuration.
Motion first_motion(const void* model, int joint);

// Every term by Pinocchio's algorithms, on one pinocchio::Data.
class PinocchioPass {
public:
    explicit PinocchioPass(const Mechanism& m);
    PinocchioPass(PinocchioPass&&) noexcept;
    ~PinocchioPass();

    struct Data;
    Data& data() { return *data_; }

private:
    std::unique_ptr<Data> data_;
};

// Each as the function of this name in terms.hpp, for the configuration in `terms`.
void place_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms);
void place_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
void move_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms, const VecX& v);
void mass_matrix(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms);
void bias_forces(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms);

}  // namespace pn
