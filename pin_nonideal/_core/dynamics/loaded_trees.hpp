// Motion of trees with friction that follows the load of its own joint, in O(n) operations.
//
// At a slipping joint the friction force is -s phi (c + L(r)) for the load L of the joint's wrench r. L is homogeneous, so
// that its linearization L(r) + g^T (r' - r) = g^T r' is a force linear in the reaction, which the oblique sweep
// (tree/oblique_sweep.hpp) solves without iteration. Newton's method repeats the sweep with new gradients g. Steps with the
// last gradients and the remaining difference of L are cheaper, and suffice near the solution.
#pragma once

#include "dynamics/unknowns.hpp"

namespace pn {

struct LoadedTreesParameters {
    double tolerance = 4e-15;         // error of the limits relative to the largest that counts as rounding error
    double stall_tolerance = 1e-12;   // error below this that no longer falls is rounding error
    double max_contraction = 0.03;    // ratio of errors above which new gradients cost less than further steps
    double min_determinant = 1e-3;    // smaller determinants are near the end of a solution, and decided elsewhere
    double min_pivot = 1e-3;          // smaller pivots, relative to those of M, lose digits
    int max_gradients = 8;            // maximum number of linearizations
};

inline constexpr LoadedTreesParameters loaded_trees_parameters{};

// Check if all unknowns are limits of friction in joints of trees without rows.
bool are_limits_of_trees(const Unknowns& unknowns);
// Compute the largest |dg_i/dy_j| over all y after `solve_loaded_trees`, into L.
void bound_loads_of_trees(Unknowns& unknowns, MatX& L);
// Solve y = g(y) from the wrenches of the last solution or from the guess in y, and set the motion. Return false if this did
// not converge.
bool solve_loaded_trees(Unknowns& unknowns, VecX& y, bool has_wrenches);

}  // namespace pn
