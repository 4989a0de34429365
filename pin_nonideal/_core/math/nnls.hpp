// Nonnegative least squares, and derived problems for the numbers N + Z z with a free z. The columns of Z are
// orthonormal, or Z holds some rows of such a matrix. [Lawson, Hanson: Solving Least Squares Problems, 1974, ch. 23.]
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

// Compute x >= 0 that minimizes |A x - b|.
VecX nonnegative_least_squares(const MatX& A, const VecX& b);

// Compute the shortest v >= 0 for which some z gives N + Z z >= -v. v is zero if all numbers can be nonnegative together.
VecX least_violation(const MatX& Z, const VecX& N);

// Compute the shortest z that makes the marked numbers zero, or as near to zero as possible.
VecX shortest_with_zeros(const MatX& Z, const VecX& N, const std::vector<char>& zero);

// Shortest z with N + Z z >= 0, or with the least violation if no z is feasible (`is_feasible` is false). `held` marks the
// numbers at zero: z is the shortest vector with these numbers at zero.
struct NonnegativeSum { VecX z; std::vector<char> held; bool is_feasible; };
NonnegativeSum shortest_nonnegative(const MatX& Z, const VecX& N);

// Largest s for which some z gives N + Z z >= s. `weight` marks the numbers that bind together: weight >= 0, Z^T
// weight = 0, sum(weight) = 1 and s = weight . N. If s has no bound, `value` is the largest entry of |N| and `weight`
// is empty.
struct MaxMin { double value; VecX weight; };
MaxMin max_min(const MatX& Z, const VecX& N);

}  // namespace pn
