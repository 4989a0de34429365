#include "constraints/redundancy.hpp"

#include "math/decompositions.hpp"

namespace pn {

// Weights of rows are solved from products of rows, which square the condition number. A second pass therefore solves
// for the rest of the dependent row, unless this rest is rounding. [Bjorck: Stability analysis of the method of
// seminormal equations, 1987.]
static constexpr double spanned = 1e-14;
static constexpr int most_passes = 2;

std::vector<int> dependent_rows(const RowSystem& s) {
    std::vector<int> dependent;
    if (!s.redundant) return dependent;
    for (size_t r = 0; r < s.required.size(); ++r)
        if (s.required[r] && !s.active[r]) dependent.push_back(static_cast<int>(r));
    return dependent;
}

MatX dependence(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B, RowSystem& s,
                const std::vector<int>& dependent) {
    const int d = static_cast<int>(dependent.size());
    MatX W(d, layout.rows);
    VecX column(s.Q.rows()), unit = VecX::Zero(layout.rows), products(layout.rows), weights(layout.rows);
    for (int k = 0; k < d; ++k) {
        column.setZero();
        unit[dependent[k]] = 1.0;
        for (int i : s.blocks) add_transpose(blocks[i], B, unit, column);
        unit[dependent[k]] = 0.0;
        const double least = spanned * column.norm();
        W.row(k).setZero();
        for (int pass = 0; pass < most_passes && column.norm() > least; ++pass) {
            products.setZero();
            for (int i : s.blocks) multiply(blocks[i], B, column, products);
            solve_rows(layout, s, products, weights);
            W.row(k) += weights.transpose();
            for (int i : s.blocks) add_transpose(blocks[i], B, -weights, column);
        }
    }
    return W;
}

void DescribedRows::finish(int kept) {
    weight = VecX::Zero(kept);
    for (const Row& row : rows) {
        if (row.kept < 0) continue;
        copied |= weight[row.kept] > 0.0;
        weight[row.kept] += row.factor * row.factor;
    }
    for (Row& row : rows)
        if (row.kept >= 0) row.part = row.factor / weight[row.kept];
}

void share_multipliers(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                       const DescribedRows& all, RowSystem& s, const VecX& lam, VecX& shared) {
    shared = lam;
    const std::vector<int> dependent = dependent_rows(s);
    if (dependent.empty()) return;
    // With weights g and x + W^T y = lam, sum(x^2/g) + sum(y^2/g) is minimal if (1/g + W (1/g) W^T) y = W (1/g) lam.
    const MatX W = dependence(layout, blocks, B, s, dependent);
    const VecX inverse = all.weight.cwiseInverse();
    MatX S = W * inverse.asDiagonal() * W.transpose();
    for (size_t k = 0; k < dependent.size(); ++k) S(k, k) += inverse[dependent[k]];
    const VecX y = solve_semidefinite(S, W * inverse.cwiseProduct(lam));
    shared -= W.transpose() * y;
    for (size_t k = 0; k < dependent.size(); ++k) shared[dependent[k]] = y[k];
}

MatX free_multipliers(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                      const DescribedRows& all, RowSystem& s) {
    const std::vector<int> dependent = dependent_rows(s);
    MatX free = -dependence(layout, blocks, B, s, dependent).transpose();
    for (size_t k = 0; k < dependent.size(); ++k) free(dependent[k], static_cast<Eigen::Index>(k)) = 1.0;
    const MatX S = free.transpose() * all.weight.cwiseInverse().asDiagonal() * free;
    Cholesky factor;
    factor.compute(S);
    return factor.solve_lower(free.transpose()).transpose();
}

}  // namespace pn
