// Rank of the rows and an independent subset, by the orthogonal factorization of B^T.
#pragma once

#include "constraints/schur_factor.hpp"

namespace pn {

// Find the rank (at most `max_rank`) and an independent subset of the required rows, by column-pivoted QR of B^T with each
// row divided by its greatest length.
void decide_rows(const Mechanism& m, Terms& terms, const std::vector<Block>& blocks,
                 const BlockValues& values, const RowEntries& B, RowSystem& s, double tolerance,
                 int max_rank);

// Check if active rows have become short or nearly dependent since they were chosen. Another choice may then be better.
bool is_choice_due(RowSystem& s);

}  // namespace pn
