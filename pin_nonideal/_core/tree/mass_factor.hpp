// The factor M = L^T D L along the tree, so R = L^T D^1/2 in M = R R^T, and what is solved with it. Trees that are deep
// have it from another recursion.
#pragma once

#include <vector>

#include "tree/terms.hpp"

namespace pn {

// M = L^T D L. Returns -1, or the dof whose pivot is not positive.
int factorize(const Mechanism& m, Terms& terms);

// x := R^-1 x = D^-1/2 L^-T x, and x := R^-T x = L^-1 D^-1/2 x. Forces `body` on the bodies of deep trees add to x.
void solve_R(const Mechanism& m, Terms& terms, VecX& x, const Force* body = nullptr);
void solve_Rt(const Mechanism& m, Terms& terms, VecX& x);
// The latter for the dofs listed, after their ancestors, of an x that is zero elsewhere before.
void solve_Rt(const Mechanism& m, Terms& terms, const std::vector<int>& dofs, VecX& x);
// y := M x on the locked dofs, whose x is zero; on the others y means nothing.
void multiply_M_locked(const Mechanism& m, Terms& terms, const VecX& x, VecX& y);
// y := M x; the part of the bodies of deep trees as forces on them, where `body` has room.
void multiply_M(const Mechanism& m, Terms& terms, const VecX& x, VecX& y, Force* body = nullptr);

}  // namespace pn
