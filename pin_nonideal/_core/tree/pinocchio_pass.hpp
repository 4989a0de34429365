// Quantities computed by Pinocchio, behind an interface without its headers: the motion of joints that only Pinocchio
// supports, and all of Terms with terms="pinocchio". No data lasts from one evaluation to the next.
#pragma once

#include <memory>
#include <vector>

#include "tree/body_terms.hpp"

namespace pn {

struct JointMotion {  // moving frame of a joint: placement from the fixed frame, motion per dof and bias in its own axes
    Mat3 R;
    Vec3 p;
    std::vector<Motion> S;
    Motion bias;
};

// Evaluator of single joints of kind `other`.
class PinocchioJoints {
public:
    PinocchioJoints();
    explicit PinocchioJoints(const Mechanism& m);
    PinocchioJoints(PinocchioJoints&&) noexcept;
    ~PinocchioJoints();
    // Compute the motion of one joint. `out.S` must have room for its dofs.
    void evaluate(const Mechanism& m, int joint, const VecX& q, const VecX& v, JointMotion& out);

private:
    struct Data;
    std::unique_ptr<Data> data_;
};

// Return the first column of the motion subspace of joint `joint` of a `pinocchio::Model`, in the joint's axes, at its
// neutral configuration.
Motion first_motion(const void* model, int joint);

// All terms by Pinocchio's algorithms, on one pinocchio::Data.
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

// Functions of terms.hpp with the same names, for the configuration in `terms`.
void place_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms);
void place_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
void move_bodies(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms, const VecX& v);
void mass_matrix(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms);
void bias_forces(const Mechanism& m, PinocchioPass& pass, BodyTerms& terms);

}  // namespace pn
