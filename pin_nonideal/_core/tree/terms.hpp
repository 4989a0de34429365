// Kinematics, M(q) and bias forces, from one of two providers: the core's own pass, or Pinocchio's algorithms.
#pragma once

#include <variant>

#include "tree/native_pass.hpp"
#include "tree/pinocchio_pass.hpp"

namespace pn {

struct Terms : BodyTerms {
    std::variant<OwnPass, PinocchioPass> pass;  // fills body, J, Ag, nle and M

    void allocate(const Mechanism& m);
};

// Placements, J and inertias of all bodies; or placements alone, of the joints listed (each after its parent), with
// their angles.
void place_bodies(const Mechanism& m, Terms& terms, const VecX& q);
void place_bodies(const Mechanism& m, Terms& terms, const VecX& q, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
// Velocities and bias accelerations of bodies in their places.
void move_bodies(const Mechanism& m, Terms& terms, const VecX& v);
// M(q) of bodies in their places, once for each placement: it sums inertias up the trees.
void mass_matrix(const Mechanism& m, Terms& terms);
// nle of bodies in motion.
void bias_forces(const Mechanism& m, Terms& terms);

// Bodies in their places and in motion.
void kinematics(const Mechanism& m, Terms& terms, const VecX& q, const VecX& v);
// M(q) and nle; needs kinematics.
void inertia(const Mechanism& m, Terms& terms);

double kinetic_energy(const Mechanism& m, Terms& terms, const VecX& v);
double potential_energy(const Mechanism& m, const Terms& terms);

}  // namespace pn
