#include "constraints/equation.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "math/lanes.hpp"
#include "math/unrolled.hpp"

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

void dense_columns(const std::vector<Block>& blocks, const std::vector<double>& B,
                   const std::vector<char>& use, RowSystem& s) {
    if (s.Q.cols() == 0) s.Q.resize(s.Q.rows(), s.scale.size());
    s.columns.clear();
    for (int index : s.blocks) {
        const Block& block = blocks[index];
        const int r = static_cast<int>(block.kept.size());
        for (int k = 0; k < r; ++k) {
            if (!use[block.row + k]) continue;
            const int c = static_cast<int>(s.columns.size());
            s.columns.push_back(block.row + k);
            auto column = s.Q.col(c);
            column.setZero();
            for (size_t l = 0; l < block.support.size(); ++l)
                column[block.support[l]] = B[block.offset + l * r + k] * s.scale[block.row + k];
        }
    }
}

// Householder factorization of the first n columns of Q in place, with column pivoting when asked. Returns the rank.
int householder(RowSystem& s, int n, bool pivot, double tolerance) {
    const int m = static_cast<int>(s.Q.rows());
    double largest = 0.0;
    for (int k = 0; k < n; ++k) {
        if (k >= m) return k;
        if (pivot) {
            int best = k;
            double best_norm = -1.0;
            for (int c = k; c < n; ++c) {
                const double norm = s.Q.col(c).tail(m - k).squaredNorm();
                if (norm > best_norm * (1.0 + 1e-12)) { best_norm = norm; best = c; }
            }
            if (best != k) {
                s.Q.col(k).swap(s.Q.col(best));
                std::swap(s.columns[k], s.columns[best]);
            }
        }
        auto x = s.Q.col(k).tail(m - k);
        const double norm = x.norm();
        largest = std::max(largest, norm);
        if (pivot && norm <= tolerance * largest) return k;
        if (norm == 0.0) { s.tau[k] = 0.0; continue; }
        const double beta = x[0] > 0.0 ? -norm : norm;
        s.tau[k] = (beta - x[0]) / beta;
        const double inverse = 1.0 / (x[0] - beta);
        x.tail(m - k - 1) *= inverse;
        x[0] = beta;
        for (int c = k + 1; c < n; ++c) {
            auto y = s.Q.col(c).tail(m - k);
            const double w = s.tau[k] * (y[0] + x.tail(m - k - 1).dot(y.tail(m - k - 1)));
            y[0] -= w;
            y.tail(m - k - 1) -= w * x.tail(m - k - 1);
        }
    }
    return n;
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

void RowSystem::allocate(const RowLayout& layout, int block_count, int nv) {
    blocks.reserve(block_count);
    block_used.assign(block_count, 0);
    G.assign(layout.entries, 0.0);
    factor.assign(layout.entries, 0.0);
    scale = VecX::Zero(layout.rows);
    active.assign(layout.rows, 0);
    wanted.assign(layout.rows, 0);
    Q.resize(nv, 0);
    tau = VecX::Zero(layout.rows);
    work = VecX::Zero(std::max(nv, layout.rows));
    columns.reserve(layout.rows);
}

void RowSystem::use_wanted(const std::vector<Block>& all) {
    blocks.clear();
    for (size_t i = 0; i < all.size(); ++i) {
        block_used[i] = 0;
        for (size_t k = 0; k < all[i].kept.size(); ++k) block_used[i] |= wanted[all[i].row + k];
        if (block_used[i]) blocks.push_back(static_cast<int>(i));
    }
    active = wanted;
    redundant = false;
    orthogonal = false;
}

// G of n1 rows of one block, from position p1, with n2 of another, from p2: B B^T summed over their common dofs, below
// the diagonal.
template <int n1, int n2>
static void multiply_tile(const double* X, int r1, const double* Y, int r2, const RowLayout::Pair& pair,
                          const RowLayout& layout, int p1, int p2, double* G) {
    double sum[n1][n2] = {};
    for (const auto& [l, k] : pair.common) {
        const double *x = X + l * r1, *y = Y + k * r2;
        for (int i = 0; i < n1; ++i)
            for (int j = 0; j < n2; ++j) sum[i][j] += x[i] * y[j];
    }
    for (int i = 0; i < n1; ++i) {
        double* row = G + layout.start[p1 + i] + p2;
        const int end = p1 + i - p2;  // the diagonal
        for (int j = 0; j < n2; ++j)
            if (j <= end) row[j] = sum[i][j];
    }
}

static void gram(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                 RowSystem& s) {
    for (const RowLayout::Pair& pair : layout.pairs) {
        if (!s.block_used[pair.block1] || !s.block_used[pair.block2]) continue;
        const Block &b1 = blocks[pair.block1], &b2 = blocks[pair.block2];
        const int r1 = static_cast<int>(b1.kept.size()), r2 = static_cast<int>(b2.kept.size());
        const double *X = B.data() + b1.offset, *Y = B.data() + b2.offset;
        for (int i0 = 0; i0 < r1; i0 += tile)  // a tile at a time
            for (int j0 = 0; j0 < r2; j0 += tile) {
                // The rows of a block stand side by side in the layout, and those of the first block not before those
                // of the second.
                const int p1 = layout.position[b1.row] + i0, p2 = layout.position[b2.row] + j0;
                with_constant(std::min(tile, r1 - i0), [&](auto n1) {
                    with_constant(std::min(tile, r2 - j0), [&](auto n2) {
                        multiply_tile<n1, n2>(X + i0, r1, Y + j0, r2, pair, layout, p1, p2, s.G.data());
                    });
                });
            }
    }
}

static void row_scales(const RowLayout& layout, const std::vector<char>& use, RowSystem& s) {
    for (int i = 0; i < layout.rows; ++i) {
        const int row = layout.row_at[i];
        if (!use[row]) continue;
        const double square = s.G[layout.start[i] + i];
        s.scale[row] = square > 0.0 ? 1.0 / std::sqrt(square) : 1.0;
    }
}

PN_WIDE void factor_rows(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                 RowSystem& s) {
    gram(layout, blocks, B, s);
    row_scales(layout, s.active, s);
    s.min_pivot = 1.0;
    s.orthogonal = false;
    double shortest = 1.0;
    for (int index : s.blocks) {
        const Block& block = blocks[index];
        if (!block.comparable_rows) continue;
        double least = HUGE_VAL, most = 0.0;
        for (size_t k = 0; k < block.kept.size(); ++k) {
            if (!s.active[block.row + k]) continue;
            const int i = layout.position[block.row + k];
            const double square = s.G[layout.start[i] + i];
            least = std::min(least, square);
            most = std::max(most, square);
        }
        if (least < shortest * most) shortest = least / most;
    }
    double* L = s.factor.data();
    for (int i = 0; i < layout.rows; ++i) {
        const int row = layout.row_at[i];
        if (!s.active[row]) continue;
        double* Li = L + layout.start[i];
        const double* Gi = s.G.data() + layout.start[i];
        const int first = layout.first[i];
        const double scale = s.scale[row];
        double pivot = Gi[i] > 0.0 ? 1.0 : 0.0;  // a row of nothing: its dofs are locked
        for (int j = first; j < i; ++j) {
            const int column = layout.row_at[j];
            if (!s.active[column]) { Li[j] = 0.0; continue; }
            const double* Lj = L + layout.start[j];
            const int common = std::max(first, layout.first[j]);
            const double sum = Gi[j] * scale * s.scale[column] - dot(Li + common, Lj + common, j - common);
            Li[j] = sum * Lj[j];  // the diagonal holds inverse pivots
            pivot -= Li[j] * Li[j];
        }
        s.min_pivot = std::min(s.min_pivot, pivot);
        if (!(pivot >= safe_pivot)) {
            s.orthogonal = true;
            break;
        }
        Li[i] = 1.0 / std::sqrt(pivot);
    }
    s.distance = std::min(shortest, s.min_pivot);
    if (s.orthogonal) {
        dense_columns(blocks, B, s.active, s);
        householder(s, static_cast<int>(s.columns.size()), false, 0.0);
    }
}

void decide_rows(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                 RowSystem& s, double tolerance) {
    gram(layout, blocks, B, s);
    row_scales(layout, s.wanted, s);
    dense_columns(blocks, B, s.wanted, s);
    s.rank = householder(s, static_cast<int>(s.columns.size()), true, tolerance);
    std::fill(s.active.begin(), s.active.end(), char(0));
    for (int k = 0; k < s.rank; ++k) s.active[s.columns[k]] = 1;
    s.redundant = s.rank < static_cast<int>(s.columns.size());
}

PN_WIDE void solve_rows(const RowLayout& layout, RowSystem& s, const VecX& r, VecX& lam) {
    lam.setZero();
    if (s.orthogonal) {  // B^T = Q T: lam = T^-1 T^-T r
        const int k = static_cast<int>(s.columns.size());
        auto y = s.work.head(k);
        for (int i = 0; i < k; ++i) {
            double sum = r[s.columns[i]] * s.scale[s.columns[i]];
            for (int j = 0; j < i; ++j) sum -= s.Q(j, i) * y[j];
            y[i] = s.Q(i, i) != 0.0 ? sum / s.Q(i, i) : 0.0;
        }
        for (int i = k - 1; i >= 0; --i) {
            double sum = y[i];
            for (int j = i + 1; j < k; ++j) sum -= s.Q(i, j) * y[j];
            y[i] = s.Q(i, i) != 0.0 ? sum / s.Q(i, i) : 0.0;
            lam[s.columns[i]] = y[i] * s.scale[s.columns[i]];
        }
        return;
    }
    const double* L = s.factor.data();
    double* __restrict y = s.work.data();
    for (int i = 0; i < layout.rows; ++i) {
        const int row = layout.row_at[i], first = layout.first[i];
        const double* Li = L + layout.start[i];
        y[i] = 0.0;
        if (s.active[row]) y[i] = (r[row] * s.scale[row] - dot(Li + first, y + first, i - first)) * Li[i];
    }
    for (int i = layout.rows - 1; i >= 0; --i) {
        const int row = layout.row_at[i];
        if (!s.active[row]) continue;
        const double* Li = L + layout.start[i];
        const double yi = y[i] * Li[i];
        for (int j = layout.first[i]; j < i; ++j) y[j] -= Li[j] * yi;
        lam[row] = yi * s.scale[row];
    }
}

void add_transpose(const Block& block, const std::vector<double>& B, const VecX& lam, VecX& y) {
    with_rows(static_cast<int>(block.kept.size()), [&](auto r) {
        const double *x = B.data() + block.offset, *l = lam.data() + block.row;
        for (size_t p = 0; p < block.support.size(); ++p, x += r) {
            double sum = 0.0;
            for (int k = 0; k < r; ++k) sum += x[k] * l[k];
            y[block.support[p]] += sum;
        }
    });
}

void multiply(const Block& block, const std::vector<double>& B, const VecX& x, VecX& r) {
    with_rows(static_cast<int>(block.kept.size()), [&](auto n) {
        const double* a = B.data() + block.offset;
        double* __restrict out = r.data() + block.row;
        for (int k = 0; k < n; ++k) out[k] = 0.0;
        for (size_t p = 0; p < block.support.size(); ++p, a += n) {
            const double xp = x[block.support[p]];
            for (int k = 0; k < n; ++k) out[k] += a[k] * xp;
        }
    });
}

}  // namespace pn
