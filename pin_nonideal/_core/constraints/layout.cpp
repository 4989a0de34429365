#include "constraints/layout.hpp"

#include <algorithm>
#include <map>
#include <numeric>

namespace pn {

namespace {

// Return an order of the blocks in which neighbors (blocks that share dofs) stand close: breadth first from a block of
// least degree, reversed (Cuthill-McKee).
std::vector<int> elimination_order(const std::vector<std::vector<int>>& neighbors) {
    const int n = static_cast<int>(neighbors.size());
    std::vector<int> order, by_degree(n);
    std::vector<char> seen(n, 0);
    std::iota(by_degree.begin(), by_degree.end(), 0);
    const auto degree = [&](int i, int j) { return neighbors[i].size() < neighbors[j].size(); };
    std::stable_sort(by_degree.begin(), by_degree.end(), degree);
    for (int start : by_degree) {
        if (seen[start]) continue;
        seen[start] = 1;
        size_t head = order.size();
        order.push_back(start);
        for (; head < order.size(); ++head) {
            std::vector<int> next;
            for (int j : neighbors[order[head]])
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
    std::vector<std::vector<int>> at_dof(nv), neighbors(n);
    for (int b = 0; b < n; ++b) {
        layout.rows += static_cast<int>(blocks[b].kept.size());
        for (int dof : blocks[b].support) at_dof[dof].push_back(b);
    }
    for (int b = 0; b < n; ++b) {
        std::vector<int>& near = neighbors[b];
        for (int dof : blocks[b].support)
            for (int c : at_dof[dof]) near.push_back(c);
        std::sort(near.begin(), near.end());
        near.erase(std::unique(near.begin(), near.end()), near.end());
    }
    const std::vector<int> order = elimination_order(neighbors);
    layout.position.resize(layout.rows);
    layout.row_at.resize(layout.rows);
    std::vector<int> place(n);
    int next = 0;
    for (int i = 0; i < n; ++i) {
        place[order[i]] = i;
        for (size_t k = 0; k < blocks[order[i]].kept.size(); ++k) {
            layout.row_at[next] = blocks[order[i]].row + static_cast<int>(k);
            layout.position[blocks[order[i]].row + k] = next++;
        }
    }
    layout.first.resize(layout.rows);
    layout.start.resize(layout.rows);
    const std::vector<int> support = numbered_supports(blocks);
    std::map<std::pair<int, int>, int> known;  // index of the common dofs of two supports
    std::vector<int> lead(n);  // first position of the first neighbor of each block
    layout.first_pair.push_back(0);
    for (int b = 0; b < n; ++b) {
        int earliest = b;
        for (int c : neighbors[b])
            if (place[c] < place[earliest] && !blocks[c].kept.empty()) earliest = c;
        lead[b] = blocks[earliest].kept.empty() ? 0 : layout.position[blocks[earliest].row];
        for (int c : neighbors[b]) {
            if (place[c] > place[b]) continue;
            const auto [found, is_new] = known.emplace(std::pair(support[b], support[c]), layout.commons.size());
            if (is_new) layout.commons.push_back(common_dofs(blocks[b], blocks[c]));
            if (!layout.commons[found->second].empty()) layout.pairs.push_back({c, found->second});
        }
        layout.first_pair.push_back(static_cast<int>(layout.pairs.size()));
    }
    for (int b = 0; b < n; ++b)
        for (size_t k = 0; k < blocks[b].kept.size(); ++k) layout.first[layout.position[blocks[b].row + k]] = lead[b];
    for (int i = 0; i < layout.rows; ++i) {
        layout.start[i] = static_cast<std::ptrdiff_t>(layout.entries) - layout.first[i];
        layout.entries += i - layout.first[i] + 1;
    }
    return layout;
}

}  // namespace pn
