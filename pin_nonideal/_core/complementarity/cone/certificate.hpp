// Certificates that a cone problem may have no solution: forces that prove it by a few products.
#pragma once

#include "complementarity/cone/interior_point.hpp"

namespace pn {

enum class ConeStatus {
    solved,
    // No forces prevent penetration. Certificate: y >= 0 on normals with -(W^T y) in the dual of the cones and
    // y . w0 < 0, so y . w < 0 for any f. Boxes count with their work at the limits.
    infeasible,
    // The motion drives contacts into each other. Certificate: y in the cones with W^T y = 0 and y . w0 < 0. A solution
    // exists if there is no such y (Klarbring, Pang, SIAM J. Optim. 8, 1998). With such a y a solution may be missing,
    // and none was found.
    jammed,
    // No solution was found. One may still exist.
    failed,
};

// Compute a certificate y in the problem's units. Returns the status that y shows, or `failed` without a certificate.
ConeStatus find_certificate(const ConeProblem& problem, VecX& y);

}  // namespace pn
