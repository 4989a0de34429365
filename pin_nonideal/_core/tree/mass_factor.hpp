// Factor M = L^T D L along the tree, that is R = L^T D^1/2 in M = R R^T, and its solves. Deep trees use another
// recursion (tree/articulated.hpp).
#pragma once

#include <vector>

#include "tree/terms.hpp"

namespace pn {

// Factorize M = L^T D L. Return -1, or the dof with a pivot that is not positive.
int factorize(const Mechanism& m, Terms& terms);

// x := R^-1 x = D^-1/2 L^-T x, and x := R^-T x = L^-1 D^-1/2 x. Forces `body` on the bodies of deep trees are added to
// x.
void solve_R(const Mechanism& m, Terms& terms, VecX& x, const Force* body = nullptr);
void solve_Rt(const Mechanism& m, Terms& terms, VecX& x);
// x := R^-T x for the listed dofs, with ancestors first. x must be zero on the other dofs.
void solve_Rt(const Mechanism& m, Terms& terms, const std::vector<int>& dofs, VecX& x);
// y := M x on the locked dofs, where x is zero. y is undefined on the other dofs.
void multiply_M_locked(const Mechanism& m, Terms& terms, const VecX& x, VecX& y);
// y := M x. If `body` is given, it takes the inertia forces on the bodies of deep trees.
void multiply_M(const Mechanism& m, Terms& terms, const VecX& x, VecX& y, Force* body = nullptr);

}  // namespace pn
