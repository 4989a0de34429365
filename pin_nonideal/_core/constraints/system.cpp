#include "constraints/system.hpp"

#include <algorithm>

namespace pn {

void RowSystem::allocate(const RowLayout& layout, int block_count, int nv) {
    blocks.reserve(block_count);
    block_used.assign(block_count, 0);
    G.allocate(layout.entries);
    factor.allocate(layout.entries);
    scale = longest = longest_chosen = VecX::Zero(layout.rows);
    active.assign(layout.rows, 0);
    required.assign(layout.rows, 0);
    Q.resize(nv, 0);
    tau = VecX::Zero(layout.rows);
    work = VecX::Zero(std::max(nv, layout.rows));
    columns.reserve(layout.rows);
}

void RowSystem::use_required(const std::vector<Block>& all) {
    blocks.clear();
    std::fill(block_used.begin(), block_used.end(), char(0));
    const auto last = std::find(required.rbegin(), required.rend(), char(1));
    const int end = static_cast<int>(required.rend() - last);  // end of the required rows
    for (size_t i = 0; i < all.size() && all[i].row < end; ++i) {
        for (size_t k = 0; k < all[i].kept.size(); ++k) block_used[i] |= required[all[i].row + k];
        if (block_used[i]) blocks.push_back(static_cast<int>(i));
    }
    active = required;
    longest.setZero();
    longest_chosen.setZero();
    chosen_pivot = 0.0;
    redundant = false;
    orthogonal = false;
}

}  // namespace pn
