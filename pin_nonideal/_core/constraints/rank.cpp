#include "constraints/rank.hpp"

#include <algorithm>
#include <cmath>

#include "constraints/qr_factor.hpp"
#include "constraints/rank_parameters.hpp"
#include "constraints/row_length.hpp"

namespace pn {

// Check if a block is a permanent constraint. Rows of contacts and friction are divided by their own length, as in the
// problems that determine the sticking elements.
static bool is_lasting(const Block& block) {
    return role(block.kind) == Role::constraint && pressing_row(block.kind) < 0;
}

// Check if a block is a holonomic constraint without frames. Such rows keep their greatest length at any pose so far.
static bool keeps_length(const Block& block, const RowValues& values) {
    return !values.geometric && !block.holonomic.empty() && block.holonomic.front();
}

static void present_lengths(const Block& block, const RowEntries& B, double* length) {
    const size_t r = block.kept.size();
    std::fill_n(length, r, 0.0);
    for (size_t l = 0; l < block.support().size(); ++l)
        for (size_t k = 0; k < r; ++k) length[k] += B[block.offset + l * r + k] * B[block.offset + l * r + k];
    for (size_t k = 0; k < r; ++k) length[k] = std::sqrt(length[k]);
}

void decide_rows(const Mechanism& m, Terms& terms, const std::vector<Block>& blocks,
                 const BlockValues& values, const RowEntries& B, RowSystem& s, double tolerance,
                 int max_rank) {
    int lasting = 0;
    for (int i : s.blocks) {
        const Block& block = blocks[i];
        double* length = s.scale.data() + block.row;
        const bool lasts = is_lasting(block), keeps = lasts && keeps_length(block, values[i]);
        if (lasts) greatest_lengths(m, terms, block, block.kept, values[i], length);
        else present_lengths(block, B, length);
        for (size_t k = 0; k < block.kept.size(); ++k) {
            if (keeps) length[k] = std::max(length[k], std::sqrt(s.longest[block.row + k]));
            length[k] = length[k] > 0.0 ? 1.0 / length[k] : 1.0;
            s.chosen_scale[block.row + k] = length[k];
            lasting += lasts && s.required[block.row + k];
        }
    }
    find_independent(blocks, B, tolerance, max_rank, lasting, s);
    s.longest_chosen.setZero();
    s.chosen_pivot = 0.0;
}

bool is_choice_due(RowSystem& s) {
    if (!s.redundant) return false;
    bool due = s.min_pivot < rank_parameters.faded_part * s.chosen_pivot;
    s.chosen_pivot = std::max(s.chosen_pivot, s.min_pivot);
    const Envelope& envelope = s.envelope;
    for (int i = 0; i < envelope.size(); ++i) {
        const int row = envelope.row_at[i];
        if (!s.required[row]) continue;
        const double square = s.G[envelope.start[i] + i];
        s.longest[row] = std::max(s.longest[row], square);
        if (!s.active[row]) continue;
        due |= square < rank_parameters.faded_part * s.longest_chosen[row];
        s.longest_chosen[row] = std::max(s.longest_chosen[row], square);
    }
    return due;
}

}  // namespace pn
