#include "constraints/row_layout.hpp"

#include <algorithm>
#include <numeric>

namespace pn {

namespace {

// Order of the blocks in which neighbors (blocks that share dofs) stand close: breadth first from a block of least
// degree, reversed (Cuthill-McKee).
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
    std::vector<int> lead(n);  // first position of the first neighbor of each block
    for (int b = 0; b < n; ++b) {
        int earliest = b;
        for (int c : neighbors[b])
            if (place[c] < place[earliest] && !blocks[c].kept.empty()) earliest = c;
        lead[b] = blocks[earliest].kept.empty() ? 0 : layout.position[blocks[earliest].row];
        for (int c : neighbors[b]) {
            if (place[c] > place[b]) continue;
            RowLayout::Pair pair{b, c, {}};
            for (size_t l = 0; l < blocks[b].support.size(); ++l)
                for (size_t k = 0; k < blocks[c].support.size(); ++k)
                    if (blocks[b].support[l] == blocks[c].support[k]) pair.common.emplace_back(l, k);
            if (!pair.common.empty()) layout.pairs.push_back(std::move(pair));
        }
    }
    for (int b = 0; b < n; ++b)
        for (size_t k = 0; k < blocks[b].kept.size(); ++k) layout.first[layout.position[blocks[b].row + k]] = lead[b];
    for (int i = 0; i < layout.rows; ++i) {
        layout.start[i] = static_cast<int>(layout.entries) - layout.first[i];
        layout.entries += i - layout.first[i] + 1;
    }
    return layout;
}

}  // namespace pn
