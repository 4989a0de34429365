// B B^T of the rows in use, its factor, and the multipliers that solve with it.
#pragma once

#include "constraints/system.hpp"

namespace pn {

// Smallest pivot of the Cholesky factor of the unit-diagonal B B^T that is trusted: its relative error stays below
// the machine precision divided by this; below it the orthogonal factorization of B^T takes over.
constexpr double safe_pivot = 1e-5;

// B B^T and its factor for the active rows; falls back to the orthogonal factorization.
void factor_rows(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                 RowSystem& s);
// lam with (B B^T) lam = r on the active rows (zero on the others); r and lam by kept row.
void solve_rows(const RowLayout& layout, RowSystem& s, const VecX& r, VecX& lam);

// The two steps before a factorization: G = B B^T, and the lengths of its rows.
void delassus(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B, RowSystem& s);
void scale_to_unit_length(const RowLayout& layout, const std::vector<char>& use, RowSystem& s);

}  // namespace pn
