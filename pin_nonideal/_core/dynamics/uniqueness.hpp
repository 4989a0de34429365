// Uniqueness of a solution y of the implicit reaction equation y = g(y).
#pragma once

#include "dynamics/unknowns.hpp"

namespace pn {

struct UniquenessParameters {
    double difference_step = 1e-7;  // relative to the unknowns: square root of the rounding error, with a margin
    int max_mixed_laws = 6;         // more laws mirror one branch at a time instead of all combinations
    double same_solution = 1e-9;    // relative residual at which a point is a solution
    double other_solution = 1e-6;   // relative distance beyond which two solutions differ
    double limit_rounding = 1e-9;  // tolerance of a holding force, relative to its limit
    // Determinants below this value count as zero.
    double min_determinant = 1e-8;
};

inline constexpr UniquenessParameters uniqueness_parameters{};

// Select a solution for loads of bearings and decide if it is unique: g is proven to contract, or all solutions are
// computed. y is Newton's solution if `solved`. `start` is the motion before, where the search began. If there are several
// solutions, y becomes the nearest to `start`, or the failure shows two.
void select_solution(Unknowns& unknowns, const ReactionEquation& equation, const VecX& start, VecX& y, bool solved);

// Solve for all zero-load sets after one set had no solution. y becomes the solution nearest to `start` in any set. If no
// set has a solution, throw `failure`.
void select_among_zero_load_sets(Unknowns& unknowns, const VecX& start, VecX& y, const Failure& failure);

// Search for other solutions with user functions among the unknowns. J is dg/dy at y. Throw a failure if the
// determinant indicates other solutions and Newton's method finds one. If no solution is found, nothing is proven. If the
// run continues, y becomes the solution that is least sensitive to changes of the loads.
void search_other_solutions(Unknowns& unknowns, VecX& y, const MatX& J, double size);
// Smallest det(I - dg/dy) over the combinations of branches of the laws.
double min_determinant(const Unknowns& unknowns, const MatX& J);
// Compute dg/dy by finite differences, scaled by the size of the unknowns.
void differentiate(Unknowns& unknowns, const VecX& y, const VecX& g, double size, MatX& J);

}  // namespace pn
