// Kinematics, M(q), bias forces and the sparse factor M = L^T D L (so R = L^T D^1/2 in M = R R^T).
//
// Everything is expressed in world axes about one reference point per kinematic tree: the place of its first joint
// that turns, frozen for the instant of the evaluation. This keeps numbers small for a robot that has walked far, on a
// floating base or on sliding joints.
#pragma once

#include <vector>

#include "tree/mechanism.hpp"

namespace pn {

struct Body {
    Mat3 R = Mat3::Identity();
    Vec3 p = Vec3::Zero();    // joint frame's origin, from the reference point
    Vec3 ref = Vec3::Zero();  // the reference point in the world
    Motion v{Vec3::Zero(), Vec3::Zero()};
    Motion a{Vec3::Zero(), Vec3::Zero()};  // acceleration at zero qdd, minus gravity
    Force f{Vec3::Zero(), Vec3::Zero()};   // bias force of the subtree
    Inertia own, Y;                        // of the body; of the subtree
};

struct Turn {  // cosine and sine of an angle
    double c = 1.0, s = 0.0;
};

struct Terms {
    std::vector<Body> body;
    std::vector<Turn> turn;  // of each joint whose configuration is an angle
    std::vector<Motion> J;  // motion per unit velocity of each dof
    std::vector<Force> Ag;  // subtree momentum per unit velocity of each dof
    VecX nle;               // bias generalized force: Coriolis, centrifugal, gravity
    std::vector<double> L;  // rows of M, then of its factor (Mechanism::row_offset)
    std::vector<double> M;  // rows of M, kept for residuals and kinetic energy
    VecX D, inv_sqrt_D;
    std::vector<char> locked;  // dofs that cannot move: they drop out of the factor, and R^-1 x is zero there
    VecX q;  // configuration with unit quaternions
    std::unique_ptr<ForeignJoints> foreign;
    JointMotion foreign_motion;
    VecX rest;  // no velocity, for the placements of foreign joints

    void allocate(const Mechanism& m);
};

// Placements, J and inertias of all bodies; or placements alone, of the joints listed (each after its parent), with
// their angles.
void place_bodies(const Mechanism& m, Terms& w, const VecX& q);
void place_bodies(const Mechanism& m, Terms& w, const VecX& q, const std::vector<int>& joints,
                  const std::vector<Angle>& angles);
// Velocities and bias accelerations of bodies in their places.
void move_bodies(const Mechanism& m, Terms& w, const VecX& v);
// M(q) of bodies in their places, once for each placement: it sums inertias up the trees.
void mass_matrix(const Mechanism& m, Terms& w);
// nle of bodies in motion.
void bias_forces(const Mechanism& m, Terms& w);

// Bodies in their places and in motion.
void kinematics(const Mechanism& m, Terms& w, const VecX& q, const VecX& v);
// M(q) and nle; needs kinematics.
void inertia(const Mechanism& m, Terms& w);
// M = L^T D L. Returns -1, or the dof whose pivot is not positive.
int factorize(const Mechanism& m, Terms& w);

// x := R^-1 x = D^-1/2 L^-T x, and x := R^-T x = L^-1 D^-1/2 x.
void solve_R(const Mechanism& m, const Terms& w, VecX& x);
void solve_Rt(const Mechanism& m, const Terms& w, VecX& x);
// The latter for the dofs listed, after their ancestors, of an x that is zero elsewhere before.
void solve_Rt(const Mechanism& m, const Terms& w, const std::vector<int>& dofs, VecX& x);
// y := M x.
void multiply_M(const Mechanism& m, const Terms& w, const VecX& x, VecX& y);

double kinetic_energy(const Mechanism& m, Terms& w, const VecX& v);
double potential_energy(const Mechanism& m, const Terms& w);

// World position, velocity and classical acceleration (at zero qdd, without gravity) of the point of a body at x.
PN_INLINE Vec3 velocity_at(const Body& b, const Vec3& x) { return b.v.lin + b.v.ang.cross(x - b.ref); }
PN_INLINE Vec3 acceleration_at(const Mechanism& m, const Body& b, const Vec3& x) {
    const Vec3 r = x - b.ref;  // Body::a carries minus gravity, also that of the world
    return b.a.lin + m.gravity + b.a.ang.cross(r) + b.v.ang.cross(b.v.lin + b.v.ang.cross(r));
}

}  // namespace pn
