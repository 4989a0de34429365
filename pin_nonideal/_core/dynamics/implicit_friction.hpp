// Motion coupled with load-dependent laws: C depends on the reactions, and the reactions depend on C.
//
// The unknown y holds the limits of slipping elements and the forces of user laws. The current factors give the motion for
// y. The motion gives the loads, and the loads give an image g(y). In trees without rows, sweeps over the bodies solve y =
// g(y) (dynamics/loaded_trees.hpp). Elsewhere fixed-point iteration solves it if it contracts well, else Newton's method,
// whose factor serves the other evaluations of the step. det(I - dg/dy) tests the uniqueness of the solution.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct ImplicitFrictionParameters {
    double tolerance = 4e-15;           // relative change of y that counts as rounding error
    double newton_tolerance = 3.2e-14;  // relative change of y after a linear solve that counts as rounding error
    double stall_tolerance = 1e-12;     // Newton error below this that no longer falls is rounding error
    double slow_change = 1e-13;         // slowly contracting changes above this are iterated further
    double max_contraction = 0.25;      // slower fixed-point iterations switch to Newton's method
    int fixed_point_limit = 30;         // maximum fixed-point iterations: 27 contract by 0.25 to rounding
    // Bound on the largest eigenvalue of |dg/dy|, the growth, below which a uniqueness proof stays valid for max(n,
    // kept_steps) steps. The proof then costs about one motion per step. The growth does not rise from this value to
    // one in so short a time.
    double safe_growth = 0.5;
    int kept_steps = 4;                   // minimum number of steps for which a uniqueness proof stays valid
    double min_zero_load_step = 0x1p-10;  // smallest fraction of the step to a solution of another zero-load set
    double min_error_gain = 0.1;          // required relative decrease of the error, per fraction of that step
    // Maximum number of zero-load sets to try, one solution each.
    int max_zero_load_sets = 30;
};

inline constexpr ImplicitFrictionParameters implicit_friction_parameters{};

// Check if any law acts. Friction of contacts does not act if all contacts are open.
inline bool laws_act(const Program& p, const Workspace& w) {
    return p.has_laws() && (!p.has_contact_friction_only || !w.now.closed_gaps.empty());
}

// Compute C of all laws that read no reactions, including slipping friction of constant limits: w.now.C_smooth.
void find_known_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Compute C, a and lam for the forces F. `known` is C of the laws that read no reactions.
void solve_with_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const VecX& known);
// Compute C, a and lam with friction limits from the last time step: its impulses divided by its length. The workspace must
// be in the state that a failure of solve_with_laws left.
void solve_with_step_friction(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
