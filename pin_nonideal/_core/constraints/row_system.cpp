#include "constraints/row_system.hpp"

#include <algorithm>

namespace pn {

void RowSystem::allocate(const RowLayout& layout, int block_count, int nv) {
    blocks.reserve(block_count);
    block_used.assign(block_count, 0);
    scale = chosen_scale = longest = longest_chosen = VecX::Zero(layout.rows);
    active.assign(layout.rows, 0);
    required.assign(layout.rows, 0);
    Q.resize(nv, 0);
    tau = VecX::Zero(layout.rows);
    work = VecX::Zero(std::max(nv, layout.rows));
    columns.reserve(layout.rows);
}

void RowSystem::use_required(const RowLayout& layout, const std::vector<Block>& all, const std::vector<int>& among) {
    for (int row : envelope.row_at) {
        active[row] = 0;
        longest[row] = longest_chosen[row] = 0.0;
    }
    for (int i : blocks) block_used[i] = 0;
    blocks.clear();
    for (int i : among) {
        const auto first = required.begin() + all[i].row;
        block_used[i] = std::find(first, first + all[i].kept.size(), char(1)) != first + all[i].kept.size();
        if (block_used[i]) blocks.push_back(i);
    }
    envelope.select(layout, all, blocks);
    for (int row : envelope.row_at) active[row] = required[row];
    G.resize(std::max(G.size(), envelope.entries));
    std::fill_n(G.begin(), envelope.entries, 0.0);
    factor.resize(G.size());
    chosen_pivot = 0.0;
    redundant = false;
    orthogonal = false;
}

}  // namespace pn
