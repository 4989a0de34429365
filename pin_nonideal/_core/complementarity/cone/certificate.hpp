// Certificates that a cone problem may have no solution: forces that prove it by a few products.
#pragma once

#include "complementarity/cone/interior_point.hpp"

namespace pn {

struct CertificateParameters {
    double min_margin = 1e-7;      // fraction of |y| |w0| by which y . w0 must be negative
    double zero_tolerance = 1e-9;  // tolerance of quantities that must vanish
    double zero_force_parts[5] = {1e-5, 1e-4, 1e-3, 1e-6, 1e-7};  // fractions of the largest force that count as zero
    double rank_threshold = 1e-8;  // rank threshold of the rows that y satisfies, relative to the largest
    int max_sharpenings = 6;       // Newton steps of y onto the edges of its cones
};

inline constexpr CertificateParameters certificate_parameters{};

enum class ConeStatus {
    solved,
    // No forces prevent penetration. Certificate: y >= 0 on normals with -(W^T y) in the dual of the cones and
    // y . w0 < 0, so y . w < 0 for any f. Boxes count with their work at the limits.
    infeasible,
    // The motion drives contacts into each other. Certificate: y in the cones with W^T y = 0 and y . w0 < 0. A solution
    // exists if there is no such y (Klarbring, Pang, SIAM J. Optim. 8, 1998). With such a y a solution may be missing,
    // and none was found.
    jammed,
    // No solution was found, but a solution may exist.
    failed,
};

// Compute a certificate y in the problem's units. Return the status that y shows, or `failed` without a certificate.
ConeStatus find_certificate(const ConeProblem& problem, VecX& y);

}  // namespace pn
