#include "constraints/layout.hpp"

#include <algorithm>
#include <map>
#include <numeric>

namespace pn {

namespace {

// Return a number for each list, the same for equal lists.
std::vector<int> numbered(const std::vector<std::vector<int>>& lists) {
    std::map<std::vector<int>, int> numbers;
    std::vector<int> out;
    for (const std::vector<int>& list : lists)
        out.push_back(numbers.emplace(list, static_cast<int>(numbers.size())).first->second);
    return out;
}

int count(const std::vector<int>& numbers) {
    return numbers.empty() ? 0 : 1 + *std::max_element(numbers.begin(), numbers.end());
}

// Blocks by group of dofs, and the neighbors of a block: the blocks with common dofs.
class Neighbors {
public:
    Neighbors(const RowLayout& layout, const std::vector<std::vector<int>>& with_support)
        : layout_(layout), in_group_(layout.group_count), degree_(with_support.size(), 0),
          met_(layout.support.size(), -1) {
        for (size_t s = 0; s < with_support.size(); ++s)
            for (int group : layout.groups[s])
                in_group_[group].insert(in_group_[group].end(), with_support[s].begin(), with_support[s].end());
        for (size_t s = 0; s < with_support.size(); ++s) each(static_cast<int>(s), [&](int) { ++degree_[s]; });
    }
    int degree(int block) const { return degree_[layout_.support[block]]; }
    template <class Act>
    void each(int support, const Act& act) {
        for (int group : layout_.groups[support])
            for (int block : in_group_[group]) {
                if (met_[block] == support) continue;
                met_[block] = support;
                act(block);
            }
    }

private:
    const RowLayout& layout_;
    std::vector<std::vector<int>> in_group_;
    std::vector<int> degree_, met_;  // per support; per block: last support that met it
};

// Return an order of the blocks in which neighbors stand close: breadth first from a block of least degree, reversed
// (Cuthill-McKee).
std::vector<int> elimination_order(const RowLayout& layout, Neighbors& near) {
    const int n = static_cast<int>(layout.support.size());
    std::vector<int> order, by_degree(n);
    std::vector<char> seen(n, 0), spread(layout.groups.size(), 0);
    std::iota(by_degree.begin(), by_degree.end(), 0);
    const auto degree = [&](int i, int j) { return near.degree(i) < near.degree(j); };
    std::stable_sort(by_degree.begin(), by_degree.end(), degree);
    for (int start : by_degree) {
        if (seen[start]) continue;
        seen[start] = 1;
        size_t head = order.size();
        order.push_back(start);
        for (; head < order.size(); ++head) {
            const int from = layout.support[order[head]];
            if (spread[from]) continue;
            spread[from] = 1;
            std::vector<int> next;
            near.each(from, [&](int j) {
                if (!seen[j]) next.push_back(j);
                seen[j] = 1;
            });
            std::sort(next.begin(), next.end());
            std::stable_sort(next.begin(), next.end(), degree);
            order.insert(order.end(), next.begin(), next.end());
        }
    }
    std::reverse(order.begin(), order.end());
    return order;
}

// Supports are in descending order.
CommonDofs common_dofs(const Block& one, const Block& other) {
    CommonDofs common;
    for (size_t l = 0, k = 0; l < one.support().size() && k < other.support().size();) {
        if (one.support()[l] == other.support()[k]) common.emplace_back(l++, k++);
        else if (one.support()[l] > other.support()[k]) ++l;
        else ++k;
    }
    return common;
}

}  // namespace

RowLayout layout_rows(const std::vector<Block>& blocks, int nv) {
    RowLayout layout;
    std::vector<std::vector<int>> supports;
    for (const Block& block : blocks) {
        layout.rows += static_cast<int>(block.kept.size());
        supports.push_back(block.support());
    }
    layout.support = numbered(supports);
    std::vector<std::vector<int>> with_support(count(layout.support)), at_dof(nv);
    for (size_t b = 0; b < blocks.size(); ++b) {
        std::vector<int>& alike = with_support[layout.support[b]];
        if (alike.empty())
            for (int dof : blocks[b].support()) at_dof[dof].push_back(layout.support[b]);
        alike.push_back(static_cast<int>(b));
    }
    const std::vector<int> group = numbered(at_dof);
    layout.group_count = count(group);
    layout.groups.resize(with_support.size());
    for (size_t s = 0; s < with_support.size(); ++s) {
        std::vector<int>& dof_groups = layout.groups[s];
        for (int dof : blocks[with_support[s].front()].support()) dof_groups.push_back(group[dof]);
        std::sort(dof_groups.begin(), dof_groups.end());
        dof_groups.erase(std::unique(dof_groups.begin(), dof_groups.end()), dof_groups.end());
    }
    Neighbors near(layout, with_support);
    const std::vector<int> order = elimination_order(layout, near);
    layout.place.resize(blocks.size());
    for (size_t i = 0; i < order.size(); ++i) layout.place[order[i]] = static_cast<int>(i);
    return layout;
}

int Envelope::find_common(const Block& one, int support, const Block& other, int other_support) {
    const auto [at, is_new] = common_of_.try_emplace({support, other_support}, static_cast<int>(commons_.size()));
    if (is_new) commons_.push_back(common_dofs(one, other));
    return at->second;
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
    of_support_.resize(layout.groups.size());
    of_group_.resize(layout.group_count);
    visitor_.resize(layout.groups.size(), -1);
    for (int b : order_) {
        const int support = layout.support[b], at = size();
        if (of_support_[support].empty())
            for (int group : layout.groups[support]) of_group_[group].push_back(support);
        of_support_[support].push_back(b);
        for (size_t k = 0; k < all[b].kept.size(); ++k) {
            position[all[b].row + k] = at + static_cast<int>(k);
            row_at.push_back(all[b].row + static_cast<int>(k));
        }
        int lead = at;
        for (int group : layout.groups[support])
            for (int other : of_group_[group]) {
                if (visitor_[other] == b) continue;
                visitor_[other] = b;
                const int common = find_common(all[b], support, all[of_support_[other].front()], other);
                for (int c : of_support_[other]) {
                    pairs.push_back({b, c, common});
                    lead = std::min(lead, position[all[c].row]);
                }
            }
        for (int i = at; i < size(); ++i) {
            first.push_back(lead);
            start.push_back(static_cast<std::ptrdiff_t>(entries) - lead);
            entries += i - lead + 1;
        }
    }
    for (int b : order_) {
        const int support = layout.support[b];
        of_support_[support].clear();
        visitor_[support] = -1;
        for (int group : layout.groups[support]) of_group_[group].clear();
    }
}

}  // namespace pn
