// Matrices by which redundant rows share their load. The matrices depend on the rows in use only, not on the forces, and
// stay valid until the rows change.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct LoadSharing {
    // Number of the factorization (RowSystem::factorization) for which the matrices are valid.
    long long factorization = 0;
    std::vector<char> active, required;  // rows for which the matrices are valid

    std::vector<int> dependent;  // required rows that depend on the active rows
    MatX W;                      // their coefficients: A_dependent = W A_active
    MatX taken;                  // multipliers of minimum norm of the dependent rows, per multiplier of the rows in use
    MatX free;                   // basis of multipliers that exert no force by position, computed at first use
    bool has_free = false;
};

}  // namespace pn
