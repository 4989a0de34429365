// Orthogonal factorization B^T = Q T of rows of unit length, for rows that the Cholesky factor of B B^T cannot
// distinguish.
#pragma once

#include "constraints/row_system.hpp"

namespace pn {

// Find the rank of the required rows and at most `max_rank` independent rows by column pivoting. These become the rows
// in use. The first `lasting` required rows belong to permanent constraints and are preferred, so that constraints alone
// carry loads that sticking elements and contacts could share.
void find_independent(const std::vector<Block>& blocks, const RowEntries& B, double tolerance, int max_rank,
                      int lasting, RowSystem& s);
// Factorize B^T = Q T for the active rows, without pivoting.
void factor_orthogonally(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s);
// Solve T^T T lam = r for lam.
void solve_orthogonally(RowSystem& s, const VecX& r, VecX& lam);

}  // namespace pn
