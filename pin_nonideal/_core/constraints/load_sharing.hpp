// Matrices by which redundant rows share their load. The matrices depend on the rows in use only, not on the forces, and
// stay valid until the rows change.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct LoadSharing {
    // Rows for which the matrices hold: entries of B of the blocks in use, and flags.
    std::vector<double> entries;
    std::vector<char> active, required;
    bool orthogonal = false;

    std::vector<int> dependent;  // required rows that depend on the active rows
    MatX W;                      // their coefficients: A_dependent = W A_active
    MatX taken;                  // multipliers of minimum norm of the dependent rows, per multiplier of the rows in use
    MatX free;                   // basis of multipliers that exert no force, computed at first use
    bool has_free = false;
};

}  // namespace pn
