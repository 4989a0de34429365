// Eq. (40) in factor form. With M = R R^T, B = A R^-T and a_s' = R^-1 (F + C):
//     B B^T lam = b - B a_s',   a_s = a_s' + B^T lam,   a = R^-T a_s.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// B = A R^-T of the rows in use.
void scale_rows(const Program& p, Workspace& w);

// Acceleration and multipliers for a given force F + C and right-hand side b, by the factors in the workspace; refined
// where light bodies spoil them.
void solve_acceleration(const Program& p, Workspace& w, const VecX& force, const VecX& b, VecX& a, VecX& lam);
// Those of the motion at hand, under its own b: w.now.a and w.now.lam.
void solve_acceleration(const Program& p, Workspace& w, const VecX& force);

// Whether sticking elements and constraints leave no freedom at all: then nothing moves, exactly.
bool is_immobile(const Program& p, const Workspace& w);
// Forces M a - F - C - A^T lam that hold the locked dofs, for the motion in the workspace.
const VecX& holding_forces(const Program& p, Workspace& w);

}  // namespace pn
