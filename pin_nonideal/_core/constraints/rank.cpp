#include "constraints/rank.hpp"

#include <algorithm>

#include "constraints/orthogonal.hpp"
#include "constraints/row_length.hpp"

namespace pn {

// Part of the square of a length, or of a pivot, below which another choice of rows is looked for.
static constexpr double faded_part = 0.1;

void decide_rows(const Mechanism& m, Terms& terms, const std::vector<Block>& blocks,
                 const std::vector<RowValues>& values, const std::vector<double>& B, RowSystem& s, double tolerance,
                 int most) {
    for (int i : s.blocks) {
        const Block& block = blocks[i];
        double* length = s.scale.data() + block.row;
        greatest_lengths(m, terms, block, block.kept, values[i], length);
        for (size_t k = 0; k < block.kept.size(); ++k) {
            if (!values[i].geometric) length[k] = std::max(length[k], std::sqrt(s.longest[block.row + k]));
            length[k] = length[k] > 0.0 ? 1.0 / length[k] : 1.0;
        }
    }
    find_independent(blocks, B, tolerance, most, s);
    s.longest_chosen.setZero();
    s.chosen_pivot = 0.0;
}

bool is_choice_due(const RowLayout& layout, RowSystem& s) {
    if (!s.redundant) return false;
    bool due = s.min_pivot < faded_part * s.chosen_pivot;
    s.chosen_pivot = std::max(s.chosen_pivot, s.min_pivot);
    for (int i = 0; i < layout.rows; ++i) {
        const int row = layout.row_at[i];
        if (!s.required[row]) continue;
        const double square = s.G[layout.start[i] + i];
        s.longest[row] = std::max(s.longest[row], square);
        if (!s.active[row]) continue;
        due |= square < faded_part * s.longest_chosen[row];
        s.longest_chosen[row] = std::max(s.longest_chosen[row], square);
    }
    return due;
}

}  // namespace pn
