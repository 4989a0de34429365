// The core's own pass over the tree: what the configuration decides first, then what the velocity adds.
#pragma once

#include <vector>

#include "tree/pinocchio_pass.hpp"

namespace pn {

struct CosSin {  // of an angle
    double c = 1.0, s = 0.0;
};

struct OwnPass {
    std::vector<CosSin> cos_sin;  // of each joint whose configuration is an angle
    PinocchioJoints others;       // joints of kind `other`
    JointMotion motion;           // of the one asked last
    VecX rest;                    // no velocity, for their placements

    OwnPass() = default;
    explicit OwnPass(const Mechanism& m);
};

// Each as the function of this name in terms.hpp, for the configuration in `terms`.
void place_bodies(const Mechanism& m, OwnPass& pass, BodyTerms& terms);
void place_bodies(const Mechanism& m, OwnPass& pass, BodyTerms& terms, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
void move_bodies(const Mechanism& m, OwnPass& pass, BodyTerms& terms, const VecX& v);
void mass_matrix(const Mechanism& m, OwnPass& pass, BodyTerms& terms);
void bias_forces(const Mechanism& m, OwnPass& pass, BodyTerms& terms);

}  // namespace pn
