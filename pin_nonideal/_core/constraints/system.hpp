// Rows in the metric of M, and the solution for their multipliers: Eq. (40) in factor form. With M = R R^T, B = A R^-T
// and a_s' = R^-1 (F + C):
//     B B^T lam = b - B a_s',   a_s = a_s' + B^T lam,   a = R^-T a_s,
// for the rows in use, which are independent: copies and vanishing rows were dropped before the run, other redundancy
// is decided at each step's start (decide_rows) and held over the step.
#pragma once

#include <vector>

#include "constraints/layout.hpp"

namespace pn {

// The choice of active rows among the required ones, and the record by which a new choice becomes due.
struct RowChoice {
    std::vector<char> active;
    bool redundant = false;  // some required row is not active
    // Kept at the starts of steps while `redundant`: the greatest square of each row's length in these modes, and the same
    // since the last choice; and the greatest of the smallest pivots since the last choice.
    VecX longest, longest_chosen;
    double chosen_pivot = 0.0;
};

struct RowSystem : RowChoice {
    std::vector<double> G, factor;  // B B^T and its Cholesky factor, in the envelope
    VecX scale;                     // 1 / length of each row of B
    std::vector<char> required;     // rows that must hold (constraints, sticking elements)
    std::vector<int> blocks;        // blocks with a required row
    std::vector<char> block_used;
    bool orthogonal = false;        // B^T = Q T in use instead of the Cholesky factor
    bool refine = false;            // very unequal pivots of M: solutions are refined
    double min_pivot = 1.0;
    // Square of the sine at which some row stands to the others, or of its length beside the other rows of its block
    // (a singular position turns a row into zero), or of a row beside its greatest length where others depend on it: small
    // near a singular position.
    double distance = 1.0;
    int rank = 0;
    // Orthogonal factorization of the scaled active rows, one column a row: no columns before it is first needed, for
    // in a mechanism of many loops it takes far more room than all else.
    MatX Q;
    VecX tau, work;
    std::vector<int> columns;

    void allocate(const RowLayout& layout, int blocks, int nv);
    // Blocks with a required row, and all required rows in use.
    void use_required(const std::vector<Block>& all);
};

}  // namespace pn
