#include "constraints/redundancy.hpp"

#include "math/decompositions.hpp"

namespace pn {

// Weights of rows are solved from products of rows, which square the condition number. A second pass therefore solves
// for the rest of the dependent row, unless this rest is rounding. [Bjorck: Stability analysis of the method of
// seminormal equations, 1987.]
static constexpr double dependent_row_rounding = 1e-14;
static constexpr int most_passes = 2;

std::vector<int> dependent_rows(const RowSystem& s) {
    std::vector<int> dependent;
    if (!s.redundant) return dependent;
    for (size_t r = 0; r < s.required.size(); ++r)
        if (s.required[r] && !s.active[r]) dependent.push_back(static_cast<int>(r));
    return dependent;
}

MatX dependence(const std::vector<Block>& blocks, const std::vector<double>& B, RowSystem& s,
                const std::vector<int>& dependent) {
    const int d = static_cast<int>(dependent.size());
    const std::vector<int>& rows = s.envelope.row_at;
    MatX W = MatX::Zero(d, s.envelope.size());
    const Eigen::Index all = s.scale.size();
    VecX column(s.Q.rows()), unit = VecX::Zero(all), products = unit, weights = unit;
    for (int k = 0; k < d; ++k) {
        column.setZero();
        unit[dependent[k]] = 1.0;
        for (int i : s.blocks) add_transpose(blocks[i], B, unit, column);
        unit[dependent[k]] = 0.0;
        const double least = dependent_row_rounding * column.norm();
        for (int pass = 0; pass < most_passes && column.norm() > least; ++pass) {
            for (int i : s.blocks) multiply(blocks[i], B, column, products);
            solve_rows(s, products, weights);
            for (size_t l = 0; l < rows.size(); ++l) W(k, l) += weights[rows[l]];
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

void share_multipliers(const std::vector<Block>& blocks, const std::vector<double>& B,
                       const DescribedRows& all, RowSystem& s, const VecX& lam, VecX& shared) {
    shared = lam;
    const std::vector<int> dependent = dependent_rows(s);
    if (dependent.empty()) return;
    // With weights g and x + W^T y = lam, sum(x^2/g) + sum(y^2/g) is minimal if (1/g + W (1/g) W^T) y = W (1/g) lam.
    const MatX W = dependence(blocks, B, s, dependent);
    const std::vector<int>& rows = s.envelope.row_at;
    VecX inverse(rows.size()), own(rows.size());
    for (size_t l = 0; l < rows.size(); ++l) {
        inverse[l] = 1.0 / all.weight[rows[l]];
        own[l] = inverse[l] * lam[rows[l]];
    }
    MatX S = W * inverse.asDiagonal() * W.transpose();
    for (size_t k = 0; k < dependent.size(); ++k) S(k, k) += 1.0 / all.weight[dependent[k]];
    const VecX y = solve_semidefinite(S, W * own), taken = W.transpose() * y;
    for (size_t l = 0; l < rows.size(); ++l) shared[rows[l]] -= taken[l];
    for (size_t k = 0; k < dependent.size(); ++k) shared[dependent[k]] = y[k];
}

MatX free_multipliers(const std::vector<Block>& blocks, const std::vector<double>& B,
                      const DescribedRows& all, RowSystem& s) {
    const std::vector<int> dependent = dependent_rows(s);
    const std::vector<int>& rows = s.envelope.row_at;
    MatX used = -dependence(blocks, B, s, dependent).transpose();
    for (size_t k = 0; k < dependent.size(); ++k)
        used(s.envelope.position[dependent[k]], static_cast<Eigen::Index>(k)) = 1.0;
    VecX inverse(rows.size());
    for (size_t l = 0; l < rows.size(); ++l) inverse[l] = 1.0 / all.weight[rows[l]];
    const MatX S = used.transpose() * inverse.asDiagonal() * used;
    Cholesky factor;
    factor.compute(S);
    used = factor.solve_lower(used.transpose()).transpose();
    MatX free = MatX::Zero(s.scale.size(), used.cols());
    for (size_t l = 0; l < rows.size(); ++l) free.row(rows[l]) = used.row(static_cast<Eigen::Index>(l));
    return free;
}

}  // namespace pn
