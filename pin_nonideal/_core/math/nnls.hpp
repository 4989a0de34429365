// Nonnegative least squares, and derived problems for the numbers N + Z z with a free z. The columns of Z are
// orthonormal, or Z holds some rows of such a matrix. [Lawson, Hanson: Solving Least Squares Problems, 1974, ch. 23.]
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct NnlsParameters {
    // Rounding error of a few products, relative to the numbers that cancel.
    double rounding = 1e-13;
    // Relative pivot below which a column counts as spanned by the others.
    double min_column_pivot = 1e-11;
    // Slack for the search of binding numbers if no z is feasible, relative to max |N|. The slack must exceed rounding.
    double binding_slack = 1e-9;
    // Rounding error of a zero in a least-squares solution, relative to the numbers that it sums.
    double met_rounding = 1e-11;
    // Projections that make a column orthogonal to others, up to rounding.
    int orthogonal_passes = 2;
    // Maximum number of exchanges per column. The method is finite and takes about one. Further exchanges are rounding
    // error.
    int exchanges = 10;
    int max_cuts = 50;  // updates of the bound in max_min, each exact for the binding numbers
};

inline constexpr NnlsParameters nnls_parameters{};

// Compute x >= 0 that minimizes |A x - b|.
VecX nonnegative_least_squares(const MatX& A, const VecX& b);

// Compute the shortest v >= 0 for which some z gives N + Z z >= -v. v is zero if all numbers can be nonnegative together.
VecX min_violation(const MatX& Z, const VecX& N);

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
