// One solution of the equation of friction at rest (equation.hpp), from a first guess. The methods are an alternation
// of limits and forces, then Newton's method, then a path from fixed limits to the limits of the loads.
#pragma once

#include "complementarity/load_dependent/equation.hpp"

namespace pn {

struct LoadDependentParameters {
    double tolerance = 1e-13;            // largest error of the equation, relative to each element's forces
    double stall_tolerance = 1e-10;      // error accepted if no step reduces it
    double max_alternation_ratio = 0.5;  // error ratio of the alternation, above which Newton's method takes over
    double limit_rounding = 1e-13;       // excess of a sticking force over its limit, relative to the largest force
    double min_residual_gain = 1e-3;     // required relative decrease of the residual by a step
    double forces_rounding = 1e-15;      // rounding error of forces, relative to the largest and for a condition of one
    int max_alternations = 40;           // maximum alternations of forces and limits
    int max_newton = 40;                 // maximum Newton steps
    int max_halvings = 12;               // maximum halvings of a Newton step that does not decrease the residual
    double decrease = 1e-4;              // required fraction of the predicted decrease
    double first_continuation_step = 0.25, min_continuation_step = 1e-4;  // steps of the continuation parameter
};

inline constexpr LoadDependentParameters load_dependent_parameters{};

// Solve for the forces x from the guess in x. Return false if no solution was found, but a solution may exist.
bool solve_rest(const RestEquation& equation, VecX& x);
// Refine x near a solution by Newton's method alone.
bool refine_rest(const RestEquation& equation, VecX& x);

// Compute forces x within all limits that keep all elements at rest, from a first guess. Return false if none were
// found. In this case x has the smallest residual found.
bool hold_at_rest(const RestEquation& equation, VecX& x);

// Return slip accelerations slightly beyond the load of a solution x, with the limits at x.
VecX onset_accelerations(const RestEquation& equation, const VecX& x);

}  // namespace pn
