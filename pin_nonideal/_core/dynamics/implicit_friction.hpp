// Motion coupled with load-dependent laws: C depends on the reactions, and the reactions depend on C.
//
// The unknown y holds the limits of slipping frictions and the forces of user laws. The current factors give the motion
// for y. The motion gives the loads, and the loads give an image g(y). Fixed-point iteration solves y = g(y) if it
// contracts well, else Newton's method. det(I - dg/dy) tests the uniqueness of the solution.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Maximum number of zero-load sets to try, one solution each.
constexpr int max_zero_load_sets = 30;

// Check if any law acts. Friction of contacts does not act if all contacts are open.
inline bool laws_act(const Program& p, const Workspace& w) {
    return p.has_laws() && (!p.has_contact_friction_only || !w.now.touching.empty());
}

// Compute C of all laws that read no reactions, including slipping friction of constant limits: w.now.C_smooth.
void find_known_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Compute C, a and lam for the forces F. `known` is C of the laws that read no reactions.
void solve_with_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const VecX& known);
// Compute the same with friction limits from the last time step: its impulses divided by its length. The workspace must
// be in the state that a failure of solve_with_laws left.
void solve_with_step_friction(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
