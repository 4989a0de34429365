// What rows that say the same carry each, where the motion tells only their sum: the multipliers of least norm, in the
// scale of the descriptions, among all that exert the same force.
#pragma once

#include "constraints/schur_factor.hpp"

namespace pn {

// Rows of all descriptions by the rows that are kept of them: copies were dropped, and carry their share all the same.
struct DescribedRows {
    struct Row {
        int kept = -1;        // the row that stands for it; -1: nothing moves along it, and it carries nothing
        double factor = 1.0;  // it is this multiple of that one
        double part = 1.0;    // its multiplier, of least norm, over that of what stands for it
    };
    std::vector<Row> rows;  // constraints and contacts in their order, then directions of friction
    VecX weight;            // of each kept row: the sum of squares of the factors of what it stands for
    bool copied = false;    // some kept row stands for several

    // Parts and weights, once all rows are known.
    void finish(int kept);
    // The multiplier of one described row for those of the kept rows.
    double share(int row, const VecX& lam) const { return rows[row].kept < 0 ? 0.0 : rows[row].part * lam[rows[row].kept]; }
};

// Rows that are required though others say the same, and their coefficients in the rows in use: A_dependent = W A_active.
std::vector<int> dependent_rows(const RowSystem& s);
MatX dependence(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B, RowSystem& s,
                const std::vector<int>& dependent);

// Multipliers of least norm by kept row, each for all that it stands for, for those of the rows in use.
void share_multipliers(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                       const DescribedRows& all, RowSystem& s, const VecX& lam, VecX& shared);

// Multipliers by kept row that exert no force together, orthonormal where each counts for all that it stands for.
MatX free_multipliers(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                      const DescribedRows& all, RowSystem& s);

}  // namespace pn
