#include "complementarity/blocks/factor.hpp"

#include <algorithm>
#include <numeric>

#include "complementarity/blocks/kernels.hpp"

namespace pn {

// Number of unknowns from which pivots are eliminated in panels.
constexpr int min_panel_size = 40;

static int root(std::vector<int>& parent, int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

Island& Islands::of_node(int node) {
    int& at = number_[root(parent_, node)];
    if (at >= 0) return islands_[at];
    at = size_++;
    if (static_cast<int>(islands_.size()) < size_) islands_.emplace_back();
    islands_[at].nodes.clear();
    islands_[at].elements.clear();
    return islands_[at];
}

void Islands::find(const BlockProblem& p) {
    const int n = static_cast<int>(p.nodes.size());
    parent_.resize(n);
    std::iota(parent_.begin(), parent_.end(), 0);
    number_.assign(n, -1);
    size_ = 0;
    for (const BlockElement& e : p.elements)
        if (e.node[1] >= 0) parent_[root(parent_, e.node[0])] = root(parent_, e.node[1]);
    for (size_t e = 0; e < p.elements.size(); ++e) of_node(p.elements[e].node[0]).elements.push_back(static_cast<int>(e));
    for (int i = 0; i < n; ++i)
        if (number_[root(parent_, i)] >= 0) of_node(i).nodes.push_back(i);
}

void BlockFactor::analyse(const BlockProblem& p, const Island& island) {
    const int n = static_cast<int>(island.nodes.size());
    links_.assign(1, n);
    for (int node : island.nodes) links_.insert(links_.end(), {node, p.nodes[node].first, p.nodes[node].size});
    for (int i : island.elements)
        if (p.elements[i].node[1] >= 0) links_.insert(links_.end(), {p.elements[i].node[0], p.elements[i].node[1]});
    place_.assign(p.nodes.size(), -1);
    if (links_ == last_links_) {
        for (int k = 0; k < n; ++k) place_[positions_[k].node] = k;
        return;
    }
    last_links_ = links_;
    for (int k = 0; k < n; ++k) place_[island.nodes[k]] = k;
    connected_.assign(static_cast<size_t>(n) * n, 0);
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        if (e.node[1] < 0) continue;
        const int a = place_[e.node[0]], b = place_[e.node[1]];
        connected_[a * n + b] = connected_[b * n + a] = 1;
    }
    pattern_.clear();
    for (int node : island.nodes) pattern_.insert(pattern_.end(), {node, p.nodes[node].first, p.nodes[node].size});
    for (int i = 0; i < n * n; ++i)
        if (connected_[i]) pattern_.push_back(i);
    if (pattern_ != last_pattern_) {
        last_pattern_ = pattern_;
        order(p, island);
    }
    for (int k = 0; k < n; ++k) place_[positions_[k].node] = k;
}

// Eliminate the node with the fewest connected nodes next (minimum degree). Large nodes come last.
void BlockFactor::order(const BlockProblem& p, const Island& island) {
    const int n = static_cast<int>(island.nodes.size());
    std::vector<int> rank(n, -1);
    std::vector<long> cost(n);
    const auto measure = [&](int i) {
        const long own = p.nodes[island.nodes[i]].size;
        long unknowns = own;
        for (int j = 0; j < n; ++j)
            if (connected_[i * n + j] && rank[j] < 0) unknowns += p.nodes[island.nodes[j]].size;
        cost[i] = unknowns * own;
    };
    for (int i = 0; i < n; ++i) measure(i);
    positions_.assign(n, {});
    for (int k = 0; k < n; ++k) {
        int best = -1;
        for (int i = 0; i < n; ++i)
            if (rank[i] < 0 && (best < 0 || cost[i] < cost[best])) best = i;
        rank[best] = k;
        Position& position = positions_[k];
        position.node = island.nodes[best];
        for (int j = 0; j < n; ++j)
            if (connected_[best * n + j] && rank[j] < 0) position.later.push_back(j);
        for (int a : position.later)
            for (int b : position.later)
                if (a != b) connected_[a * n + b] = 1;
        for (int j : position.later) measure(j);
    }
    entries_.assign(static_cast<size_t>(n) * n, -1);
    size_t at = 0;
    int exchanges = 0;
    for (int k = 0; k < n; ++k) {
        Position& position = positions_[k];
        position.size = p.nodes[position.node].size;
        position.first = p.nodes[position.node].first;
        position.exchanges = exchanges;
        exchanges += position.size;
        for (int& j : position.later) j = rank[j];
        std::sort(position.later.begin(), position.later.end());
    }
    const auto take = [&](int row, int column) {
        const int here = static_cast<int>(at);
        entry(row, column) = here;
        at += static_cast<size_t>(positions_[row].size) * positions_[column].size;
        return here;
    };
    for (int k = 0; k < n; ++k) {
        positions_[k].diagonal = take(k, k);
        for (int j : positions_[k].later) positions_[k].above.push_back(take(k, j));
        for (int j : positions_[k].later) positions_[k].below.push_back(take(j, k));
    }
    size_ = at;
    exchanges_.assign(exchanges, 0);
}

// Add J_a^T K to a block, with K = G J_b.
static PN_INLINE void add_block(double* H, const double* Ja, const double* K, int dim, int na, int nb) {
    if (na == 6 && nb == 6 && dim == 3) add_three_by_six(H, Ja, K);
    else if (na == 6 && nb == 6) add_transpose_product<6>(H, Ja, K, dim, 6, 6);
    else add_transpose_product(H, Ja, K, dim, na, nb);
}

PN_WIDE void BlockFactor::assemble(const BlockProblem& p, const Island& island, const std::vector<double>& G) {
    H_.resize(std::max(H_.size(), size_));
    std::fill(H_.begin(), H_.begin() + size_, 0.0);
    for (const Position& position : positions_) {
        const BlockNode& node = p.nodes[position.node];
        const double* M = p.M.data() + node.M;
        if (!node.normalized) std::copy(M, M + position.size * position.size, H_.begin() + position.diagonal);
        else for (int k = 0; k < node.size; ++k) H_[position.diagonal + k * (node.size + 1)] = 1.0;
    }
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const double* g = G.data() + 9 * i;
        const int d = e.dim(), a = place_[e.node[0]], na = positions_[a].size;
        if (std::all_of(g, g + d * d, [](double x) { return x == 0.0; })) continue;
        const double* Ja = p.J.data() + e.J[0];
        if (e.column >= 0) {
            H_[positions_[a].diagonal + e.column * (na + 1)] += g[0] * Ja[e.column] * Ja[e.column];
            continue;
        }
        const int sides = e.node[1] < 0 ? 1 : 2;
        for (int side = 0; side < sides; ++side) {  // columns of this side's node
            const int column = place_[e.node[side]], n = positions_[column].size;
            const double* J = p.J.data() + e.J[side];
            double K6[18];
            double* K = K6;
            if (n == 6 && d == 3) {
                multiply_three<6>(g, J, K);
            } else {
                K_.assign(d * n, 0.0);
                K = K_.data();
                for (int r = 0; r < d; ++r)
                    for (int s = 0; s < d; ++s)
                        for (int k = 0; k < n; ++k) K[r * n + k] += g[r * d + s] * J[s * n + k];
            }
            add_block(&H_[positions_[column].diagonal], J, K, d, n, n);
            if (sides == 1) continue;
            const int row = place_[e.node[1 - side]], m = positions_[row].size;
            if (row < column || !symmetric_)
                add_block(&H_[entry(row, column)], p.J.data() + e.J[1 - side], K, d, m, n);
        }
    }
}

bool BlockFactor::factor(const BlockProblem& p, const Island& island, const std::vector<double>& G, bool symmetric) {
    symmetric_ = symmetric;
    assemble(p, island, G);
    return symmetric ? eliminate_symmetric() : eliminate_general();
}

PN_WIDE bool BlockFactor::eliminate_symmetric() {
    for (const Position& k : positions_) {
        double* D = &H_[k.diagonal];
        if (!cholesky(D, k.size)) return false;
        for (size_t j = 0; j < k.later.size(); ++j) {
            const int m = positions_[k.later[j]].size;
            if (k.size == 6 && m == 6) solve_lower_six(D, &H_[k.above[j]]);
            else solve_lower_columns(D, k.size, &H_[k.above[j]], m);
        }
        for (size_t i = 0; i < k.later.size(); ++i)
            for (size_t j = i; j < k.later.size(); ++j) {
                const int m = positions_[k.later[i]].size, n = positions_[k.later[j]].size;
                double* C = &H_[entry(k.later[i], k.later[j])];
                if (k.size == 6 && m == 6 && n == 6)
                    subtract_six<true>(C, &H_[k.above[i]], &H_[k.above[j]]);
                else subtract_transpose_product(C, &H_[k.above[i]], &H_[k.above[j]], m, k.size, n);
            }
    }
    return true;
}

PN_WIDE bool BlockFactor::eliminate_general() {
    for (const Position& k : positions_) {
        double* D = &H_[k.diagonal];
        int* exchanges = &exchanges_[k.exchanges];
        const bool is_large = k.size >= min_panel_size;
        if (!(is_large ? eliminate<panel>(D, exchanges, k.size) : eliminate(D, exchanges, k.size))) return false;
        for (size_t j = 0; j < k.later.size(); ++j) {
            const int m = positions_[k.later[j]].size;
            if (k.size == 6 && m == 6) substitute_six(D, exchanges, &H_[k.above[j]]);
            else substitute(D, exchanges, k.size, &H_[k.above[j]], m);
        }
        for (size_t i = 0; i < k.later.size(); ++i)
            for (size_t j = 0; j < k.later.size(); ++j) {
                const int m = positions_[k.later[i]].size, n = positions_[k.later[j]].size;
                double* C = &H_[entry(k.later[i], k.later[j])];
                if (k.size == 6 && m == 6 && n == 6) subtract_six<false>(C, &H_[k.below[i]], &H_[k.above[j]]);
                else subtract_product(C, &H_[k.below[i]], &H_[k.above[j]], m, k.size, n);
            }
    }
    return true;
}

PN_WIDE void BlockFactor::solve(VecX& x) const {
    for (const Position& k : positions_) {
        double* b = x.data() + k.first;
        const double* D = &H_[k.diagonal];
        if (symmetric_) solve_lower(D, k.size, b);
        else substitute(D, &exchanges_[k.exchanges], k.size, b, 1);
        for (size_t j = 0; j < k.later.size(); ++j) {
            const Position& later = positions_[k.later[j]];
            double* c = x.data() + later.first;
            if (symmetric_) subtract_transpose_product(c, &H_[k.above[j]], b, later.size, k.size, 1);
            else subtract_product(c, &H_[k.below[j]], b, later.size, k.size, 1);
        }
    }
    for (int at = static_cast<int>(positions_.size()) - 1; at >= 0; --at) {
        const Position& k = positions_[at];
        double* b = x.data() + k.first;
        for (size_t j = 0; j < k.later.size(); ++j) {
            const Position& later = positions_[k.later[j]];
            subtract_product(b, &H_[k.above[j]], x.data() + later.first, k.size, later.size, 1);
        }
        if (symmetric_) solve_lower_transpose(&H_[k.diagonal], k.size, b);
    }
}

}  // namespace pn
