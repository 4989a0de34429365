// Kinematics, M(q) and bias forces from one of two providers: the native pass, or Pinocchio's algorithms.
#pragma once

#include <variant>

#include "tree/native_pass.hpp"
#include "tree/pinocchio_pass.hpp"

namespace pn {

struct Terms : BodyTerms {
    std::variant<NativePass, PinocchioPass> pass;  // fills body, J, Ag, nle and M

    void allocate(const Mechanism& m);
};

// Compute placements, J and inertias of all bodies. The second function computes placements alone, of the listed joints
// (each after its parent) with their angles.
void place_bodies(const Mechanism& m, Terms& terms, const VecX& q);
void place_bodies(const Mechanism& m, Terms& terms, const VecX& q, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
// Compute velocities and bias accelerations of placed bodies.
void move_bodies(const Mechanism& m, Terms& terms, const VecX& v);
// Compute M(q) of placed bodies. Call it once per placement, because it sums inertias up the trees.
void mass_matrix(const Mechanism& m, Terms& terms);
// Compute nle of bodies with known velocities.
void bias_forces(const Mechanism& m, Terms& terms);

// Compute placements and velocities of the bodies.
void kinematics(const Mechanism& m, Terms& terms, const VecX& q, const VecX& v);
// Compute M(q) and nle. Requires kinematics.
void inertia(const Mechanism& m, Terms& terms);

double kinetic_energy(const Mechanism& m, Terms& terms, const VecX& v);
double potential_energy(const Mechanism& m, const Terms& terms);

}  // namespace pn
