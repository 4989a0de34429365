// Rank of the rows and an independent subset, by the orthogonal factorization of B^T.
#pragma once

#include "constraints/schur_factor.hpp"

namespace pn {

// Rank tolerance on the pivots of B^T with rows over their greatest length: rounding and the constraints' own violation
// reach about 1e-12 on the manifold, true directions of light mechanisms lie above 1e-7.
constexpr double rank_tolerance = 1e-10;
// The same while elements stick. What they hold by a smaller part of their forces than this they do not hold: it is the
// square root of the threshold on responses in the program that finds the modes (rank_threshold).
constexpr double rank_tolerance_sticking = 3e-7;

// Rank, `most` at most, and independent subset of the required rows, by column-pivoted QR of B^T, each row over its
// greatest length.
void decide_rows(const Mechanism& m, Terms& terms, const std::vector<Block>& blocks,
                 const std::vector<RowValues>& values, const std::vector<double>& B, RowSystem& s, double tolerance,
                 int most);

// Whether active rows have become short, or alike, since they were chosen, so that others may serve better.
bool is_choice_due(const RowLayout& layout, RowSystem& s);

}  // namespace pn
