#include "complementarity/blocks/problem.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/blocks/kernels.hpp"

namespace pn {

void BlockProblem::clear() {
    nodes.clear();
    elements.clear();
    M.clear();
    J.clear();
    rows = 0;
}

BlockMap BlockProblem::add_node(int size, int first) {
    nodes.push_back({size, first, static_cast<int>(M.size())});
    M.resize(M.size() + size * size, 0.0);
    return {M.data() + nodes.back().M, size, size};
}

int BlockProblem::add_element(const ConeElement& cone, int node, int other) {
    BlockElement e;
    e.cone = cone;
    e.row = rows;
    e.node[0] = node;
    e.node[1] = other;
    for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
        e.J[side] = static_cast<int>(J.size());
        J.resize(J.size() + cone.dim * nodes[e.node[side]].size, 0.0);
    }
    rows += cone.dim;
    elements.push_back(e);
    return static_cast<int>(elements.size()) - 1;
}

bool BlockProblem::factor() {
    L_ = M;
    for (const BlockNode& node : nodes)
        if (!cholesky(L_.data() + node.M, node.size)) return false;
    return true;
}

PN_WIDE void BlockProblem::normalize() {
    for (BlockNode& node : nodes) node.normalized = node.size == 6;
    for (const BlockElement& e : elements)
        if (e.column >= 0) nodes[e.node[0]].normalized = false;
    for (const BlockElement& e : elements)
        for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
            const BlockNode& node = nodes[e.node[side]];
            if (!node.normalized) continue;
            for (int k = 0; k < e.dim(); ++k) solve_lower<6>(L_.data() + node.M, 6, J.data() + e.J[side] + 6 * k);
        }
}

void BlockProblem::to_unknowns(VecX& x) const {
    for (const BlockNode& node : nodes) {
        if (!node.normalized) continue;
        const double* L = L_.data() + node.M;
        double* at = x.data() + node.first;
        for (int i = 0; i < node.size; ++i) {
            at[i] /= L[i * (node.size + 1)];
            for (int k = i + 1; k < node.size; ++k) at[i] += L[k * node.size + i] * at[k];
        }
    }
}

void BlockProblem::from_unknowns(VecX& x) const {
    for (const BlockNode& node : nodes)
        if (node.normalized) solve_lower_transpose(L_.data() + node.M, node.size, x.data() + node.first);
}

PN_WIDE void BlockProblem::solve_mass(int n, VecX& x) const {
    const BlockNode& node = nodes[n];
    if (node.normalized) return;
    const double* L = L_.data() + node.M;
    double* at = x.data() + node.first;
    if (node.size == 6) {
        solve_lower<6>(L, 6, at);
        solve_lower_transpose<6>(L, 6, at);
    } else {
        solve_lower(L, node.size, at);
        solve_lower_transpose(L, node.size, at);
    }
}

PN_INLINE void BlockProblem::respond_inline(const BlockElement& e, const VecX& x, VecX& w) const {
    if (e.column >= 0) {
        w[e.row] = J[e.J[0] + e.column] * x[nodes[e.node[0]].first + e.column];
        return;
    }
    for (int k = 0; k < e.dim(); ++k) w[e.row + k] = 0.0;
    for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
        const BlockNode& node = nodes[e.node[side]];
        const double *block = J.data() + e.J[side], *at = x.data() + node.first;
        if (node.size == 6) add_product<6>(block, e.dim(), 6, at, w.data() + e.row);
        else add_product(block, e.dim(), node.size, at, w.data() + e.row);
    }
}

PN_WIDE void BlockProblem::respond(const BlockElement& e, const VecX& x, VecX& w) const { respond_inline(e, x, w); }

PN_WIDE void BlockProblem::respond(const std::vector<int>& list, const VecX& x, VecX& w) const {
    for (const int i : list) respond_inline(elements[i], x, w);
}

PN_INLINE void BlockProblem::push_inline(const BlockElement& e, const VecX& f, VecX& x) const {
    if (e.column >= 0) {
        x[nodes[e.node[0]].first + e.column] += J[e.J[0] + e.column] * f[e.row];
        return;
    }
    for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
        const BlockNode& node = nodes[e.node[side]];
        const double* block = J.data() + e.J[side];
        double* at = x.data() + node.first;
        if (node.size == 6) add_transpose<6>(block, e.dim(), 6, f.data() + e.row, at);
        else add_transpose(block, e.dim(), node.size, f.data() + e.row, at);
    }
}

PN_WIDE void BlockProblem::push(const BlockElement& e, const VecX& f, VecX& x) const { push_inline(e, f, x); }

PN_WIDE void BlockProblem::push(const std::vector<int>& list, const VecX& f, VecX& x) const {
    for (const int i : list) push_inline(elements[i], f, x);
}

// Add J J^T to W, for the rows J of an element in mass-normalized unknowns. Entry k of row i is J[k * next + i * other].
static PN_INLINE void add_response(const double* J, int n, int next, int other, int dim, Mat3& W) {
    for (int i = 0; i < dim; ++i)
        for (int j = 0; j < dim; ++j) {
            double sum = 0.0;
            for (int k = 0; k < n; ++k) sum += J[k * next + i * other] * J[k * next + j * other];
            W.c[j][i] += sum;
        }
}

// On nodes with other unknowns the rows of all elements enter the substitution together.
PN_WIDE void BlockProblem::own_responses(const std::vector<int>& list, std::vector<Mat3>& W) const {
    sides_.resize(std::max(sides_.size(), nodes.size()));
    for (const int i : list) {
        const BlockElement& e = elements[i];
        for (Vec3& column : W[i].c) column = Vec3::Zero();
        for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
            const BlockNode& node = nodes[e.node[side]];
            if (node.normalized) {
                add_response(J.data() + e.J[side], node.size, 1, node.size, e.dim(), W[i]);
                continue;
            }
            if (sides_[e.node[side]].empty()) touched_.push_back(e.node[side]);
            sides_[e.node[side]].push_back(2 * i + side);
        }
    }
    for (const int at : touched_) {
        const BlockNode& node = nodes[at];
        int count = 0;
        for (const int side : sides_[at]) count += elements[side / 2].dim();
        columns_.resize(std::max(columns_.size(), static_cast<size_t>(count) * node.size));
        int column = 0;
        for (const int side : sides_[at]) {
            const BlockElement& e = elements[side / 2];
            const double* rows = J.data() + e.J[side % 2];
            for (int k = 0; k < e.dim(); ++k, ++column)
                for (int r = 0; r < node.size; ++r) columns_[r * count + column] = rows[k * node.size + r];
        }
        solve_lower_columns(L_.data() + node.M, node.size, columns_.data(), count);
        column = 0;
        for (const int side : sides_[at]) {
            add_response(columns_.data() + column, node.size, count, 1, elements[side / 2].dim(), W[side / 2]);
            column += elements[side / 2].dim();
        }
        sides_[at].clear();
    }
    touched_.clear();
}

}  // namespace pn
