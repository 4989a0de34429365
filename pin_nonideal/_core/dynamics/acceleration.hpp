// Eq. (40) in factor form. With M = R R^T, B = A R^-T and a_s' = R^-1 (F + C):
//     B B^T lam = b - B a_s',   a_s = a_s' + B^T lam,   a = R^-T a_s.
#pragma once

#include <climits>

#include "dynamics/workspace.hpp"
#include "math/tolerances.hpp"

namespace pn {

// B = A R^-T of the rows in use.
void scale_rows(const Program& p, Workspace& w);
// Choose at most `max_rank` independent rows among the required ones and factor them.
void choose_rows(const Program& p, Workspace& w, double tolerance = rank_tolerance, int max_rank = INT_MAX);

// Turn the force x into a_s, the acceleration scaled by R, and compute the multipliers lam. Return |a_s'|^2, the
// squared length of the result without rows.
double solve_scaled(const Program& p, Workspace& w, VecX& x, const Force* body, const VecX& b, VecX& lam);
// Compute acceleration and multipliers for a generalized force and right-hand side b with the factors in the workspace.
// Light bodies trigger iterative refinement. `body` adds forces on the bodies of deep trees.
void solve_acceleration(const Program& p, Workspace& w, const VecX& force, const VecX& b, VecX& a, VecX& lam,
                        const std::vector<Force>* body = nullptr);
// Compute acceleration and multipliers of the current motion under the force F, or F + C if `with_laws`. The short form
// reads the right-hand side w.now.b, and writes w.now.a and w.now.lam.
void solve_motion(const Program& p, Workspace& w, bool with_laws);
void solve_motion(const Program& p, Workspace& w, bool with_laws, const VecX& b, VecX& a, VecX& lam);

// Check if sticking elements and constraints remove all degrees of freedom. Such a mechanism is exactly at rest.
bool is_immobile(const Program& p, const Workspace& w);
// Forces M a - F - C - A^T lam that hold the locked dofs, for the motion in the workspace.
const VecX& holding_forces(const Program& p, Workspace& w);

}  // namespace pn
