// Results of a pass over the tree: placements and motions of the bodies, M(q) and the bias forces.
//
// All quantities are in world axes about one reference point per kinematic tree. The reference point is the origin of the
// first joint that turns, frozen for the instant of the evaluation. Numbers stay small for a robot far from the world's
// origin, on a floating base or on sliding joints. In a deep tree each body has its own reference point, the origin of its
// joint. About a point a hundred links away, the inertia of the body would lose most digits.
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
    Inertia inertia, Y;                    // inertia of the body (native pass only), and of its subtree (Y)
};

// Quantities of a deep tree that replace the rows of M.
struct Articulation {
    std::vector<Vec3> shift;  // per joint: from the parent's reference point to its own
    std::vector<Force> bias;  // per joint: bias force of the body alone
    std::vector<ArticulatedInertia> inertia;  // per joint: articulated inertia of its subtree
    std::vector<Force> gain;  // per dof: P S / D, by which a unit of net force on the dof reduces the force on the body
    std::vector<Force> forces;    // forces of the sweep toward the roots
    std::vector<Motion> motions;  // motions of the sweep toward the leaves
};

struct BodyTerms {
    std::vector<Body> body;
    std::vector<Motion> J;  // motion per unit velocity of each dof
    std::vector<Force> Ag;  // subtree momentum per unit velocity of each dof
    VecX nle;               // bias generalized force: Coriolis, centrifugal, gravity
    std::vector<double> M;  // rows of M (Mechanism::row_offset)
    std::vector<double> L;  // rows of the factor, M = L^T D L
    VecX D, inv_sqrt_D;
    std::vector<char> locked;  // dofs that cannot move, absent from the factor (R^-1 x is zero there)
    VecX q;  // configuration with unit quaternions
    Articulation deep;
};

// Transform a motion, and the inertia of a body, from the body's axes and origin to world axes and the reference point.
PN_INLINE Motion in_world(const Body& b, const Motion& local) {
    const Vec3 ang = b.R * local.ang;
    Motion out{b.p.cross(ang), ang};
    out.lin += b.R * local.lin;
    return out;
}
PN_INLINE Inertia in_world(const Body& b, double mass, const Vec3& com, const Mat3& about_com) {
    const Vec3 c = b.p + b.R * com;
    Inertia Y;
    Y.mass = mass;
    Y.first = mass * c;
    Y.second = times_transpose(b.R * about_com, b.R);
    const double square = c.dot(Y.first);
    Y.second.c[0] += square * Vec3::UnitX() - c[0] * Y.first;
    Y.second.c[1] += square * Vec3::UnitY() - c[1] * Y.first;
    Y.second.c[2] += square * Vec3::UnitZ() - c[2] * Y.first;
    return Y;
}

// Return the bias force of one body without its subtree.
PN_INLINE Force bias_force(const Body& b) {
    Force f = b.inertia * b.a;
    f += cross(b.v, b.inertia * b.v);
    return f;
}

// Velocity and classical acceleration (at zero qdd, without gravity) of the point of a body at the world position x.
PN_INLINE Vec3 velocity_at(const Body& b, const Vec3& x) { return b.v.lin + b.v.ang.cross(x - b.ref); }
PN_INLINE Vec3 acceleration_at(const Mechanism& m, const Body& b, const Vec3& x) {
    const Vec3 r = x - b.ref;  // Body::a includes minus gravity, also for the world
    return b.a.lin + m.gravity + b.a.ang.cross(r) + b.v.ang.cross(b.v.lin + b.v.ang.cross(r));
}

}  // namespace pn
