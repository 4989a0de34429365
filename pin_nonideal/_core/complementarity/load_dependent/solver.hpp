// One solution of the rest equation, from a first guess. The methods are an alternation of limits and forces, then
// Newton's method, then a path from fixed limits to those of the loads.
#pragma once

#include "complementarity/load_dependent/equation.hpp"

namespace pn {

// Solve for the forces x from the guess in x. Returns false if no solution was found. One may still exist.
bool solve_rest(const RestEquation& equation, VecX& x);
// Refine x near a solution by Newton's method alone.
bool refine_rest(const RestEquation& equation, VecX& x);

// Find forces x that keep all elements at rest, from a first guess: zero accelerations, and no force beyond its limit.
// Returns false if none were found. x is then the nearest point found.
bool hold_at_rest(const RestEquation& equation, VecX& x);

// Return slip accelerations slightly beyond the load of a solution x, with the limits at x.
VecX onset_accelerations(const RestEquation& equation, const VecX& x);

}  // namespace pn
