#include "constraints/pull_feasibility.hpp"

#include <algorithm>

#include "math/decompositions.hpp"
#include "math/nnls.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

// Return a basis of the multipliers of all described rows that together exert no force. The rows of Z follow the
// described rows, and its columns are orthonormal. A_first has one described row for each row in use. The other described
// rows are A_others = C A_first. Then y_first = -C^T z and y_others = z.
MatX free_described(const std::vector<Block>& blocks, const RowEntries& B,
                    const DescribedRows& all, RowSystem& s) {
    const std::vector<int> dependent = dependent_rows(s);
    const MatX W = dependence(blocks, B, s, dependent);
    const int used = s.envelope.size();
    std::vector<int> first(used, -1), place(used, -1), others;
    for (size_t k = 0; k < dependent.size(); ++k) place[s.envelope.position[dependent[k]]] = static_cast<int>(k);
    for (int i = 0; i < static_cast<int>(all.rows.size()); ++i) {
        const int kept = all.rows[i].kept;
        if (kept < 0 || !s.required[kept]) continue;
        int& represents = first[s.envelope.position[kept]];
        if (s.active[kept] && represents < 0 && all.rows[i].factor == 1.0) represents = i;
        else others.push_back(i);
    }
    const int n = static_cast<int>(others.size());
    MatX C = MatX::Zero(n, used);
    for (int k = 0; k < n; ++k) {
        const DescribedRows::Row& row = all.rows[others[k]];
        const int at = s.envelope.position[row.kept];
        if (place[at] >= 0) C.row(k) = row.factor * W.row(place[at]);
        else C(k, at) = row.factor;
    }
    MatX Z = MatX::Zero(static_cast<Eigen::Index>(all.rows.size()), n);
    for (int r = 0; r < used; ++r)
        if (first[r] >= 0) Z.row(first[r]) = -C.col(r).transpose();
    for (int k = 0; k < n; ++k) Z(others[k], k) = 1.0;
    const MatX S = MatX::Identity(n, n) + C * C.transpose();
    Cholesky factor;
    factor.compute(S);
    return factor.solve_lower(Z.transpose()).transpose();
}

// Return the entries of these multipliers at the pressing rows.
MatX of_pressing(const std::vector<int>& pressing, const MatX& Z) {
    MatX part(static_cast<Eigen::Index>(pressing.size()), Z.cols());
    for (size_t k = 0; k < pressing.size(); ++k) {
        part.row(k) = Z.row(pressing[k]);
        if (!(part.row(k).norm() > min_null_space_entry)) part.row(k).setZero();
    }
    return part;
}

// Return all rows that share a load with one row, directly or not, with that row first.
std::vector<int> sharing_with(int index, const MatX& Z) {
    const MatX coupling = Z * Z.transpose();
    std::vector<int> found{index};
    for (size_t k = 0; k < found.size(); ++k)
        for (int j = 0; j < static_cast<int>(Z.rows()); ++j)
            if (std::abs(coupling(found[k], j)) > min_null_space_entry * min_null_space_entry &&
                std::find(found.begin(), found.end(), j) == found.end())
                found.push_back(j);
    return found;
}

}  // namespace

PullMargin press(const std::vector<Block>& blocks, const RowEntries& B,
            const DescribedRows& all, const std::vector<int>& pressing, RowSystem& s, const VecX& shared, int index) {
    const double multiplier = all.share(pressing[index], shared);
    const PullMargin alone{multiplier, {index}, {index}, multiplier < 0.0};
    if (!s.redundant && !all.copied) return alone;
    const MatX of_all = of_pressing(pressing, free_described(blocks, B, all, s));
    if (of_all.row(index).isZero(0.0)) return alone;
    PullMargin found{multiplier, sharing_with(index, of_all), {}, false};
    const int n = static_cast<int>(found.sharing.size());
    MatX Z(n, of_all.cols());
    VecX N(n);
    for (int k = 0; k < n; ++k) {
        Z.row(k) = of_all.row(found.sharing[k]);
        N[k] = all.share(pressing[found.sharing[k]], shared);
    }
    const MaxMin least = max_min(Z, N);
    found.margin = least.value;
    found.must_pull = least.value < -pull_feasibility_parameters.margin_rounding * N.cwiseAbs().maxCoeff();
    for (int k = 0; k < least.weight.size(); ++k)
        if (least.weight[k] > pull_feasibility_parameters.binding * least.weight.maxCoeff())
            found.pulling.push_back(found.sharing[k]);
    return found;
}

}  // namespace pn
