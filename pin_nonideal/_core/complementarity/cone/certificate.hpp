// Why a cone problem may have no solution, shown by forces that anyone can check.
#pragma once

#include "complementarity/cone/interior_point.hpp"

namespace pn {

enum class ConeStatus {
    solved,
    // No forces keep the contacts from being entered: y >= 0 on normals with -(W^T y) in the dual of the cones (for
    // boxes: its work at their limits counted) and y . w0 < 0, so y . w < 0 whatever f.
    infeasible,
    // The motion drives contacts into each other: y in the cones with W^T y = 0 and y . w0 < 0. A solution exists
    // whenever there is no such y (Klarbring, Pang, SIAM J. Optim. 8, 1998); with one it may not, and none was found.
    jammed,
    // None was found, which proves nothing.
    failed,
};

// y in the problem's units, and what it shows; `failed` without any.
ConeStatus find_certificate(const ConeProblem& problem, VecX& y);

}  // namespace pn
