// Least squares under signs, and what follows from it for numbers N + Z z with a free z, where Z has orthonormal columns
// or is a part of the rows of such a matrix. [Lawson, Hanson: Solving Least Squares Problems, 1974, ch. 23.]
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

// x >= 0 with least |A x - b|.
VecX nonnegative_least_squares(const MatX& A, const VecX& b);

// The least |v|, v >= 0, with which some N + Z z >= -v: zero where all of them can be positive together.
VecX least_violation(const MatX& Z, const VecX& N);

// The shortest z with which some of the numbers are zero, or as near to it as they can be together.
VecX shortest_with_zeros(const MatX& Z, const VecX& N, const std::vector<char>& zero);

// The shortest z with N + Z z >= 0, or with the least violation where there is none, and which of the numbers it holds:
// it is the shortest one with these at zero.
struct Nonnegative { VecX z; std::vector<char> held; bool met; };
Nonnegative shortest_nonnegative(const MatX& Z, const VecX& N);

// The largest s with which some N + Z z >= s, where `weight` holds which of them are at it together: weight >= 0,
// Z^T weight = 0 and sum(weight) = 1, so that s = weight . N. Where all can grow without bound, the largest of |N|, and
// no weight.
struct LargestLeast { double value; VecX weight; };
LargestLeast largest_least(const MatX& Z, const VecX& N);

}  // namespace pn
