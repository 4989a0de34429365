// Eq. (40) in factor form. With M = R R^T, B = A R^-T and a_s' = R^-1 (F + C):
//     B B^T lam = b - B a_s',   a_s = a_s' + B^T lam,   a = R^-T a_s.
#pragma once

#include <climits>

#include "dynamics/workspace.hpp"

namespace pn {

// B = A R^-T of the rows in use.
void scale_rows(const Program& p, Workspace& w);
// An independent choice of the required rows, `most` at most, and its factor.
void choose_rows(const Program& p, Workspace& w, double tolerance = rank_tolerance, int most = INT_MAX);

// x, a force, becomes a_s, the acceleration scaled by R; lam are the multipliers.
// Returns the square of what it would be without rows.
double solve_scaled(const Program& p, Workspace& w, VecX& x, const Force* body, const VecX& b, VecX& lam);
// Acceleration and multipliers under a generalized force and right-hand side b, by the factors in the workspace; refined
// where light bodies spoil them. `body` adds forces on the bodies of deep trees.
void solve_acceleration(const Program& p, Workspace& w, const VecX& force, const VecX& b, VecX& a, VecX& lam,
                        const std::vector<Force>* body = nullptr);
// Those of the motion at hand, under its own F, and C where the laws act: w.now.a and w.now.lam under its own b, or others.
void solve_motion(const Program& p, Workspace& w, bool with_laws);
void solve_motion(const Program& p, Workspace& w, bool with_laws, const VecX& b, VecX& a, VecX& lam);

// Whether sticking elements and constraints leave no freedom at all: then nothing moves, exactly.
bool is_immobile(const Program& p, const Workspace& w);
// Forces M a - F - C - A^T lam that hold the locked dofs, for the motion in the workspace.
const VecX& holding_forces(const Program& p, Workspace& w);

}  // namespace pn
