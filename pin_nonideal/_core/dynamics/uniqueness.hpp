// Whether a solution y of the implicit reaction equation y = g(y) is the only one.
#pragma once

#include "dynamics/unknowns.hpp"

namespace pn {

// Determinants below this are not told from zero.
constexpr double least_determinant_told = 1e-8;

// Of bearings: where g contracts, or all solutions are found, this is shown. y is Newton's solution, or none when not
// `solved`; `start` is where the search began, the motion before. Where there are several, y becomes the one nearest to
// it or the failure shows two.
void decide(Unknowns& unknowns, const ReactionEquation& equation, const VecX& start, VecX& y, bool solved);

// Where one piece of the loads that contacts share has no solution, as `failure` says: y becomes the solution nearest to
// `start` in any piece, or the failure holds of all.
void decide_over_pieces(Unknowns& unknowns, const VecX& start, VecX& y, const Failure& failure);

// With functions of the user's among the unknowns, whose dg/dy at y is J: a failure where the determinant tells of
// others and Newton's method finds one. That it finds none shows nothing. Where the run is to continue, y becomes the
// one in which a small change of the loads changes little.
void look_for_others(Unknowns& unknowns, VecX& y, const MatX& J, double size);
// Least det(I - dg/dy) over the mixtures of branches of the laws.
double least_determinant(const Unknowns& unknowns, const MatX& J);
// dg/dy by differences, scaled by the unknowns' size.
void differentiate(Unknowns& unknowns, const VecX& y, const VecX& g, double size, MatX& J);

}  // namespace pn
