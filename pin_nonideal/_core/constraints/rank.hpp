// Rank of the rows and an independent subset, by the orthogonal factorization of B^T.
#pragma once

#include "constraints/schur_factor.hpp"

namespace pn {

// Rank tolerance on the pivots of B^T, with each row divided by its greatest length. On the manifold, rounding and
// constraint drift reach about 1e-12. True directions of light mechanisms lie above 1e-7.
constexpr double rank_tolerance = 1e-10;
// Rank tolerance while elements stick. A direction held by a smaller part of their forces counts as free. It is the
// square root of the threshold on responses in the program that finds the modes (rank_threshold).
constexpr double rank_tolerance_sticking = 3e-7;

// Find the rank (at most `most`) and an independent subset of the required rows, by column-pivoted QR of B^T with each
// row divided by its greatest length.
void decide_rows(const Mechanism& m, Terms& terms, const std::vector<Block>& blocks,
                 const std::vector<RowValues>& values, const std::vector<double>& B, RowSystem& s, double tolerance,
                 int most);

// Check if active rows have become short or nearly dependent since they were chosen. Another choice may then be better.
bool is_choice_due(RowSystem& s);

}  // namespace pn
