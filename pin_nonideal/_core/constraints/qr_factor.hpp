// The orthogonal factorization B^T = Q T of rows of unit length, for those that the Cholesky factor of B B^T cannot tell
// apart.
#pragma once

#include "constraints/system.hpp"

namespace pn {

// Rank of the required rows and a choice of independent ones, `most` at most, which become the rows in use, by column
// pivoting.
void find_independent(const std::vector<Block>& blocks, const std::vector<double>& B, double tolerance, int most,
                      RowSystem& s);
// B^T = Q T of the active rows, as they stand.
void factor_orthogonally(const std::vector<Block>& blocks, const std::vector<double>& B, RowSystem& s);
// lam with T^T T lam = r.
void solve_orthogonally(RowSystem& s, const VecX& r, VecX& lam);

}  // namespace pn
