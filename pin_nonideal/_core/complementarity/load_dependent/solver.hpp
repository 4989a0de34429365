// One solution of the equation of rest, from a first guess: limits and forces in turn, then Newton's method, then a path
// from limits that stand still to those that follow the load.
#pragma once

#include "complementarity/load_dependent/equation.hpp"

namespace pn {

// Forces x in place of the guess; false if none was found, which is no proof that there is none.
bool solve_rest(const RestEquation& equation, VecX& x);
// Newton's method alone, near a solution.
bool refine_rest(const RestEquation& equation, VecX& x);

// Forces x under which everything at rest stays there, from a first guess: where nothing accelerates and no force passes
// its limit. False where none was found; x is then the nearest to it.
bool hold_at_rest(const RestEquation& equation, VecX& x);

// Slip accelerations a little beyond the load of a solution x, by the limits that it has.
VecX onset_accelerations(const RestEquation& equation, const VecX& x);

}  // namespace pn
