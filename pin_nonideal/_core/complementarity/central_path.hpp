// Central path of an element's laws: its force z and its velocity u with de Saxce's correction, as points of second-order
// cones with z o u = target, in Nesterov and Todd's scaling. Steps along the path are Mehrotra's predictor-corrector steps.
#pragma once

#include "complementarity/cone/problem.hpp"
#include "complementarity/second_order_cone.hpp"

namespace pn {

// Return the scale that makes the cone |f_t| <= mu f_n circular, root = sqrt(mu): forces become (root f_n, f_t / root), and
// velocities (u_n / root, root u_t).
inline double circular_scale(ConeKind kind, int tails, double mu) {
    return kind == ConeKind::contact && tails > 0 && mu > 0.0 ? std::sqrt(mu) : 1.0;
}

inline int head_rows(const ConeElement& e) { return e.is(ConeKind::contact) ? 1 : 0; }

// Return the number of tangential rows that may carry a force of a cone.
inline int tail_rows(const ConeElement& e) {
    return e.is(ConeKind::equality) || !(e.bound > 0.0) ? 0 : e.dim - head_rows(e);
}

inline bool has_cone(const ConeElement& e) { return e.is(ConeKind::contact) || tail_rows(e) > 0; }

struct PathPoint {
    Cone z, u, du;
    Cone second;  // second-order terms of the predictor step
    Scaling scaling;
    double speed = 0.0;                              // |w_t|
    Eigen::Vector3d slip = Eigen::Vector3d::Zero();  // direction of the slip

    void scale() {
        scaling = Scaling(z, u);
        second = Cone();
    }
    // Compute the step of u to z o u = target for a constant z.
    void aim(double target) {
        Cone d = product(scaling.scaled, scaling.scaled) * -1.0 - second;
        d.head += target;
        du = scaling.back(quotient(d, scaling.scaled));
    }
    // Add the change of u due to the step dz.
    void follow(const Cone& dz) { du = du - scaling.back(scaling.back(dz)); }
    void correct(const Cone& dz) { second = product(scaling.back(dz), scaling.forth(du)); }
    // Return the fraction of the steps dz and du that reaches the boundary of a cone.
    double room_for(const Cone& dz) const { return std::min(room(z, dz), room(u, du)); }
    // Move to a force after a fraction of the step. Return true if both points are inside their cones.
    bool move(const Cone& force, double part) {
        z = force;
        u = u + du * part;
        return z.determinant() > 0.0 && u.determinant() > 0.0;
    }
};

}  // namespace pn
