// Uniqueness of a solution y of the implicit reaction equation y = g(y).
#pragma once

#include "dynamics/unknowns.hpp"

namespace pn {

// Determinants below this value count as zero.
constexpr double least_determinant_told = 1e-8;

// Decide uniqueness for bearings: g contracts, or all solutions are found. y is Newton's solution if `solved`. `start`
// is the motion before, where the search began. If there are several solutions, y becomes the nearest to `start`, or
// the failure shows two.
void decide(Unknowns& unknowns, const ReactionEquation& equation, const VecX& start, VecX& y, bool solved);

// Solve with all zero-load sets after one of them had no solution. y becomes the solution nearest to `start` in any
// set. If no set has a solution, throw `failure`.
void decide_over_pieces(Unknowns& unknowns, const VecX& start, VecX& y, const Failure& failure);

// Search for other solutions with user functions among the unknowns. J is dg/dy at y. Throws a failure if the
// determinant indicates other solutions and Newton's method finds one. Finding none proves nothing. If the run
// continues, y becomes the solution that is least sensitive to changes of the loads.
void look_for_others(Unknowns& unknowns, VecX& y, const MatX& J, double size);
// Smallest det(I - dg/dy) over the combinations of branches of the laws.
double least_determinant(const Unknowns& unknowns, const MatX& J);
// Compute dg/dy by finite differences, scaled by the size of the unknowns.
void differentiate(Unknowns& unknowns, const VecX& y, const VecX& g, double size, MatX& J);

}  // namespace pn
