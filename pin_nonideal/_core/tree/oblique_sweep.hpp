// Articulated-body recursion for joint forces that follow the joint's reaction. Without such forces the reaction r of a
// joint, the force on its body, satisfies S^T r = x for each dof with motion S and generalized force x. A force that is
// linear in the reaction, x + g^T r, moves to the other side: T^T r = x with T = S - g. The recursion then projects
// along S, but not orthogonally to it, and the articulated inertias lose their symmetry:
//
//     D = T^T P S + armature,   P := P - (P S)(P^T T)^T / D
//
// The product of D over the product of the pivots of M is the determinant of I - dx/dx, the sensitivity of the forces to
// themselves by the reactions.
#pragma once

#include <vector>

#include "tree/body_terms.hpp"

namespace pn {

class ObliqueSweep {
public:
    void resize(const Mechanism& m);

    // T of each dof, about the reference point of its body. The caller sets it before `factorize`.
    std::vector<Motion> axis;
    // Reaction of each joint in the last solution, about the reference point of its body, for the forces given there.
    std::vector<Force> reaction;

    // Compute the pivots for the bodies placed in `terms`. Return false if a pivot is not finite or zero.
    bool factorize(const Mechanism& m, const BodyTerms& terms);
    // Product of the pivots relative to those of M in `terms`.
    double relative_determinant(const BodyTerms& terms) const;
    // Least magnitude of a pivot relative to that of M.
    double least_relative_pivot(const BodyTerms& terms) const;
    // x := accelerations for the forces x. Forces `body` on the bodies of deep trees are added to x if given.
    void solve(const Mechanism& m, const BodyTerms& terms, const Force* body, VecX& x);

private:
    // Inertia of a body and of the bodies that hang on it, in blocks: force (lin a + couple w, cross a + ang w).
    struct Blocks {
        Mat3 lin, couple, cross, ang;
    };
    std::vector<Blocks> inertia_;  // per joint: part that its parent carries
    std::vector<Force> force_;     // per joint: force on the bodies beyond it that its parent carries
    std::vector<Force> taken_;     // per dof: P S, force per unit acceleration
    std::vector<Force> row_;       // per dof: P^T T
    std::vector<Motion> motion_;   // per joint: acceleration of its body
    VecX inverse_, left_;          // per dof: 1/D, and net force divided by D
};

}  // namespace pn
