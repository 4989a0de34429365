// The motion together with the laws that its reactions load: C depends on the reactions, which depend on C.
//
// Unknown y: the limits of slipping frictions and the forces of user laws. Given y the motion follows from the
// factors at hand, the motion gives the loads, and the loads give an image g(y). A fixed point is iterated while it
// contracts well; else Newton's method solves y = g(y). det(I - dg/dy) tells whether the solution is the only one.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Whether any law acts: friction of contacts does not where all are open.
inline bool laws_act(const Program& p, const Workspace& w) {
    return p.has_laws() && (!p.rubs_while_closed || !w.now.touching.empty());
}

// C of all that reads no reactions, slipping friction of constant limits among it, into w.now.C_smooth.
void find_known_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// C, a and lam for the forces F, what is known of C (the laws that read no reactions), and the laws that do.
void solve_with_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const VecX& known);
// The same where what slips rubs as it did in the step of time stepping that has led here, by its percussions over its
// length; with the workspace as a failure of the above has left it.
void solve_with_step_friction(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
