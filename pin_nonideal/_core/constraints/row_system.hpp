// Rows in the metric of M, and the solution for their multipliers: Eq. (40) in factor form. With M = R R^T, B = A R^-T
// and a_s' = R^-1 (F + C):
//     B B^T lam = b - B a_s',   a_s = a_s' + B^T lam,   a = R^-T a_s.
// The rows in use are independent. Duplicate and vanishing rows were removed before the run. Other redundancy is decided
// at the start of each step (decide_rows) and kept over the step.
#pragma once

#include <algorithm>
#include <climits>
#include <vector>

#include "constraints/layout.hpp"
#include "constraints/load_sharing.hpp"

namespace pn {

// Choice of active rows among the required ones, and the records that make a new choice due or test dependent rows.
struct RowChoice {
    std::vector<char> active;
    bool redundant = false;  // some required row is not active
    // Updated at the starts of steps while `redundant`. longest: greatest squared length of each row in these modes.
    // longest_chosen: greatest squared length since the last choice. chosen_pivot: greatest of the smallest pivots since the
    // last choice.
    VecX longest, longest_chosen;
    double chosen_pivot = 0.0;
    VecX chosen_scale;  // 1 / length of each row of B by which the last choice scaled it
};

struct RowSystem : RowChoice {
    Envelope envelope;              // envelope of the blocks in use
    std::vector<double> G, factor;  // B B^T and its Cholesky factor, in the envelope
    VecX scale;                     // 1 / length of each active row of B
    std::vector<char> required;     // rows that must hold (constraints, sticking elements)
    std::vector<int> blocks;        // blocks with a required row
    std::vector<char> block_used;
    bool orthogonal = false;        // B^T = Q T in use instead of the Cholesky factor
    bool refine = false;            // very unequal pivots of M: solutions are refined
    double min_pivot = 1.0;
    // Distance from a singular position, small near it. The distance is the minimum of three squares: (a) sine of the angle
    // between a row and the others, (b) length of a row relative to the longest row of its block (a singular position turns
    // a row into zero), (c) length of a row relative to its greatest length, if other rows depend on it.
    double distance = 1.0;
    int rank = 0;
    // Orthogonal factorization of the scaled active rows, one column per row. Columns are allocated on first use,
    // because a mechanism of many loops needs far more memory for them than for all else.
    MatX Q;
    VecX tau, work;
    std::vector<int> columns;
    long long factorization = 1;  // number of the factorization of these rows, positive
    LoadSharing sharing;

    int active_count() const { return static_cast<int>(std::count(active.begin(), active.end(), char(1))); }
    // Many contacts have many rows, which are counted only for a known rank.
    bool has_rank_up_to(int max_rank) const { return max_rank == INT_MAX || active_count() <= max_rank; }
    int required_count() const { return static_cast<int>(std::count(required.begin(), required.end(), char(1))); }
    void allocate(const RowLayout& layout, int blocks, int nv);
    // Select the blocks with a required row, which are `among` some blocks, and use all required rows.
    void use_required(const RowLayout& layout, const std::vector<Block>& all, const std::vector<int>& among);
};

}  // namespace pn
