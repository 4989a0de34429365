#include "constraints/redundancy.hpp"

namespace pn {

void share_multipliers(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                       RowSystem& s, const VecX& lam, VecX& shared) {
    shared = lam;
    if (!s.redundant) return;
    // A_dependent = W A_active; x + W^T y = lam with least |x|^2 + |y|^2 is y = (I + W W^T)^-1 W lam, x = lam - W^T y.
    std::vector<int> dependent;
    for (int r = 0; r < layout.rows; ++r)
        if (s.required[r] && !s.active[r]) dependent.push_back(r);
    const int d = static_cast<int>(dependent.size());
    MatX W(d, layout.rows);
    VecX column(s.Q.rows()), unit = VecX::Zero(layout.rows), products(layout.rows), weights(layout.rows);
    for (int k = 0; k < d; ++k) {
        column.setZero();
        products.setZero();
        unit[dependent[k]] = 1.0;
        for (int i : s.blocks) add_transpose(blocks[i], B, unit, column);
        unit[dependent[k]] = 0.0;
        for (int i : s.blocks) multiply(blocks[i], B, column, products);
        solve_rows(layout, s, products, weights);
        W.row(k) = weights.transpose();
    }
    const MatX S = MatX::Identity(d, d) + W * W.transpose();
    const VecX y = S.ldlt().solve(W * lam);
    shared -= W.transpose() * y;
    for (int k = 0; k < d; ++k) shared[dependent[k]] = y[k];
}

}  // namespace pn
