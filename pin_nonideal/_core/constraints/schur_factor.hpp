// Delassus matrix B B^T of the rows in use, its factor, and the multipliers that solve with it.
#pragma once

#include "constraints/row_system.hpp"

namespace pn {

// Compute B B^T and its factor for the active rows. Falls back to the orthogonal factorization.
void factor_rows(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s);
// Solve (B B^T) lam = r on the active rows (zero on the others). r and lam have one entry per kept row.
void solve_rows(RowSystem& s, const VecX& r, VecX& lam);
// Compute the entries of the active rows only. The other entries of lam must be zero.
void solve_active_rows(RowSystem& s, const VecX& r, VecX& lam);

// Steps before a factorization: compute G = B B^T, and the inverse lengths of its rows.
void delassus(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s);
void scale_to_unit_length(const std::vector<char>& use, RowSystem& s);

}  // namespace pn
