#include "constraints/layout.hpp"

#include <algorithm>
#include <map>
#include <numeric>

namespace pn {

namespace {

// Return an order of the blocks in which neighbors (blocks that share dofs) stand close: breadth first from a block of
// least degree, reversed (Cuthill-McKee). `near`: neighbors of the blocks with each support.
std::vector<int> elimination_order(const std::vector<int>& support, const std::vector<std::vector<int>>& near) {
    const int n = static_cast<int>(support.size());
    std::vector<int> order, by_degree(n);
    std::vector<char> seen(n, 0), spread(near.size(), 0);
    std::iota(by_degree.begin(), by_degree.end(), 0);
    const auto degree = [&](int i, int j) { return near[support[i]].size() < near[support[j]].size(); };
    std::stable_sort(by_degree.begin(), by_degree.end(), degree);
    for (int start : by_degree) {
        if (seen[start]) continue;
        seen[start] = 1;
        size_t head = order.size();
        order.push_back(start);
        for (; head < order.size(); ++head) {
            const int from = support[order[head]];
            if (spread[from]) continue;
            spread[from] = 1;
            std::vector<int> next;
            for (int j : near[from])
                if (!seen[j]) { seen[j] = 1; next.push_back(j); }
            std::stable_sort(next.begin(), next.end(), degree);
            order.insert(order.end(), next.begin(), next.end());
        }
    }
    std::reverse(order.begin(), order.end());
    return order;
}

// Return a number per block, the same for blocks with the same support.
std::vector<int> numbered_supports(const std::vector<Block>& blocks) {
    std::map<std::vector<int>, int> numbers;
    std::vector<int> out;
    for (const Block& block : blocks)
        out.push_back(numbers.emplace(block.support, static_cast<int>(numbers.size())).first->second);
    return out;
}

RowLayout::Common common_dofs(const Block& one, const Block& other) {
    RowLayout::Common common;
    for (size_t l = 0; l < one.support.size(); ++l)
        for (size_t k = 0; k < other.support.size(); ++k)
            if (one.support[l] == other.support[k]) common.emplace_back(l, k);
    return common;
}

}  // namespace

RowLayout layout_rows(const std::vector<Block>& blocks, int nv) {
    RowLayout layout;
    const int n = static_cast<int>(blocks.size());
    layout.support = numbered_supports(blocks);
    const int supports = n == 0 ? 0 : 1 + *std::max_element(layout.support.begin(), layout.support.end());
    std::vector<std::vector<int>> with_support(supports), at_dof(nv), near(supports);
    for (int b = 0; b < n; ++b) {
        layout.rows += static_cast<int>(blocks[b].kept.size());
        std::vector<int>& alike = with_support[layout.support[b]];
        if (alike.empty())
            for (int dof : blocks[b].support) at_dof[dof].push_back(layout.support[b]);
        alike.push_back(b);
    }
    layout.neighbors.resize(supports);
    for (int s = 0; s < supports; ++s) {
        const Block& one = blocks[with_support[s].front()];
        std::vector<int> others;
        for (int dof : one.support) others.insert(others.end(), at_dof[dof].begin(), at_dof[dof].end());
        std::sort(others.begin(), others.end());
        others.erase(std::unique(others.begin(), others.end()), others.end());
        for (int other : others) {
            layout.neighbors[s].push_back({other, static_cast<int>(layout.commons.size())});
            layout.commons.push_back(common_dofs(one, blocks[with_support[other].front()]));
            near[s].insert(near[s].end(), with_support[other].begin(), with_support[other].end());
        }
        std::sort(near[s].begin(), near[s].end());
    }
    const std::vector<int> order = elimination_order(layout.support, near);
    layout.place.resize(n);
    for (int i = 0; i < n; ++i) layout.place[order[i]] = i;
    return layout;
}

void Envelope::select(const RowLayout& layout, const std::vector<Block>& all, const std::vector<int>& used) {
    order_ = used;
    std::sort(order_.begin(), order_.end(), [&](int a, int b) { return layout.place[a] < layout.place[b]; });
    position.resize(layout.rows);
    row_at.clear();
    first.clear();
    start.clear();
    pairs.clear();
    entries = 0;
    of_support_.resize(layout.neighbors.size());
    for (int b : order_) {
        const int support = layout.support[b], at = size();
        of_support_[support].push_back(b);
        for (size_t k = 0; k < all[b].kept.size(); ++k) {
            position[all[b].row + k] = at + static_cast<int>(k);
            row_at.push_back(all[b].row + static_cast<int>(k));
        }
        int lead = at;
        for (const auto& [other, common] : layout.neighbors[support])
            for (int c : of_support_[other]) {
                pairs.push_back({b, c, common});
                lead = std::min(lead, position[all[c].row]);
            }
        for (int i = at; i < size(); ++i) {
            first.push_back(lead);
            start.push_back(static_cast<std::ptrdiff_t>(entries) - lead);
            entries += i - lead + 1;
        }
    }
    for (int b : order_) of_support_[layout.support[b]].clear();
}

}  // namespace pn
