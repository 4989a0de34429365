// Rank of the rows and an independent subset, by the orthogonal factorization of B^T.
#pragma once

#include "constraints/row_factor.hpp"

namespace pn {

// Rank tolerance on the pivots of B^T with rows of unit length: rounding and the constraints' own violation reach
// about 1e-12 on the manifold, true directions of light mechanisms lie above 1e-7.
constexpr double rank_tolerance = 1e-10;
// The same while elements stick. What they hold by a smaller part of their forces than this they do not hold: it is the
// square root of the threshold on responses in the program that finds the modes (rank_threshold).
constexpr double rank_tolerance_sticking = 3e-7;

// Rank and independent subset of the required rows, by column-pivoted QR of B^T.
void decide_rows(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                 RowSystem& s, double tolerance = rank_tolerance);

}  // namespace pn
