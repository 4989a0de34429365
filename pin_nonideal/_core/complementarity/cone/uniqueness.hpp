// Proof that all solutions of a cone problem have the same velocities.
//
// Two solutions with forces f, g and velocities w, u differ by d = f - g, and w - u = W d. The laws of Signorini and Coulomb
// give
//     d . W d <= sum mu_i |d_n,i| |(W d)_t,i|
// over the contacts i. With W = C C^T, where C has full column rank, and z = C^T d the left side is |z|^2. If z determines
// the normal force of each rough contact, d_n,i = b_i . z, the right side is at most z . S z,
//     S = sum mu_i / 2 (r_i A_i^T A_i + b_i b_i^T / r_i)     for any r_i > 0,
// with the rows A_i of C for the slip of contact i. If the largest eigenvalue of S is below 1, then z = 0.
#pragma once

#include "complementarity/cone/problem.hpp"

namespace pn {

struct ConeUniquenessParameters {
    // Rounding error of the largest eigenvalue.
    double rounding = 1e-9;
    // Smallest eigenvalue of W that counts, relative to the largest. Forces along the other directions move nothing.
    double min_response = 1e-11;
    // Largest squared component of a normal force along such directions that counts as rounding error.
    double max_share = 1e-12;
    // Maximum number of rows. The cost grows with the cube of the number.
    int max_rows = 120;
};

inline constexpr ConeUniquenessParameters cone_uniqueness_parameters{};

// Check if the bound above proves that the problem has one motion.
bool has_one_motion(const MatX& W, const std::vector<ConeElement>& elements);

}  // namespace pn
