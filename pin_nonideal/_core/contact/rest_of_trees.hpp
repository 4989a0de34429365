// Rest of many contacts on trees that no constraint joins, without the matrix of their responses.
#pragma once

#include <vector>

#include "complementarity/cone/problem.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

struct RestOfTreesParameters {
    // Error of the forces that counts as rounding error.
    double tolerance = 1e-10;
    // Largest force, relative to the load of all trees. Rounding error of larger, squeezing forces is as large as the load.
    double max_force_ratio = 1e4;
};

inline constexpr RestOfTreesParameters rest_of_trees_parameters{};

// Check if contacts and friction elements at rest hold a scene at rest. The workspace is evaluated without their forces,
// with v = 0. `cones`: laws of the contacts, then of the other elements. Return false if the laws allow a motion, if no
// solution was found, or if constraints join the trees: other solvers then decide.
bool rest_on_trees(const Program& p, Workspace& w, const std::vector<int>& gaps, const std::vector<int>& others,
                   const std::vector<ConeElement>& cones);

}  // namespace pn
