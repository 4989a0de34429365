// Native pass over the tree: quantities that depend on the configuration first, then those that depend on the velocity.
#pragma once

#include <vector>

#include "tree/pinocchio_pass.hpp"

namespace pn {

struct CosSin {  // cosine and sine of an angle
    double c = 1.0, s = 0.0;
};

struct NativePass {
    std::vector<CosSin> cos_sin;  // per joint, set if its configuration is an angle
    PinocchioJoints others;       // joints of kind `other`
    JointMotion motion;           // motion of the joint evaluated last
    VecX rest;                    // zero velocity, to evaluate placements of these joints

    NativePass() = default;
    explicit NativePass(const Mechanism& m);
};

// Functions of terms.hpp with the same names, for the configuration in `terms`.
void place_bodies(const Mechanism& m, NativePass& pass, BodyTerms& terms);
void place_bodies(const Mechanism& m, NativePass& pass, BodyTerms& terms, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
void move_bodies(const Mechanism& m, NativePass& pass, BodyTerms& terms, const VecX& v);
void mass_matrix(const Mechanism& m, NativePass& pass, BodyTerms& terms);
void bias_forces(const Mechanism& m, NativePass& pass, BodyTerms& terms);

}  // namespace pn
