#include "constraints/qr_factor.hpp"

#include <algorithm>

#include "constraints/rank_parameters.hpp"

namespace pn {

namespace {

// Copy the rows in use, scaled to unit length, to the columns of Q.
void dense_columns(const std::vector<Block>& blocks, const RowEntries& B,
                   const std::vector<char>& use, RowSystem& s) {
    if (s.Q.cols() < s.envelope.size()) s.Q.resize(s.Q.rows(), s.envelope.size());
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
            for (size_t l = 0; l < block.support().size(); ++l)
                column[block.support()[l]] = B[block.offset + l * r + k] * s.scale[block.row + k];
        }
    }
}

// Return the column from k to n that is longest below row k.
int longest_column(const RowSystem& s, int k, int n) {
    const Eigen::Index length = s.Q.rows() - k;
    int best = k;
    double best_norm = -1.0;
    for (int c = k; c < n; ++c) {
        const double norm = s.Q.col(c).tail(length).squaredNorm();
        if (norm > best_norm * (1.0 + rank_parameters.tie)) { best_norm = norm; best = c; }
    }
    return best;
}

// Factorize the first n columns of Q in place by Householder reflectors, with column pivoting if `pivot`. Return the rank.
// The first `lasting` columns are pivots as long as they are clearly independent.
int householder(RowSystem& s, int n, bool pivot, double tolerance, int lasting = 0) {
    const int m = static_cast<int>(s.Q.rows());
    for (int k = 0; k < n; ++k) {
        if (k >= m) return k;
        if (pivot) {
            int best = longest_column(s, k, std::max(k + 1, lasting));
            if (k >= lasting || s.Q.col(best).tail(m - k).norm() <= rank_parameters.clear_pivot) {
                best = longest_column(s, k, n);
                lasting = 0;
            }
            if (best != k) {
                s.Q.col(k).swap(s.Q.col(best));
                std::swap(s.columns[k], s.columns[best]);
            }
        }
        auto x = s.Q.col(k).tail(m - k);
        const double norm = x.norm();
        if (pivot && norm <= tolerance) return k;
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

void find_independent(const std::vector<Block>& blocks, const RowEntries& B, double tolerance, int max_rank,
                      int lasting, RowSystem& s) {
    dense_columns(blocks, B, s.required, s);
    s.rank = std::min(max_rank, householder(s, static_cast<int>(s.columns.size()), true, tolerance, lasting));
    std::fill(s.active.begin(), s.active.end(), char(0));
    for (int k = 0; k < s.rank; ++k) s.active[s.columns[k]] = 1;
    s.redundant = s.rank < static_cast<int>(s.columns.size());
}

void factor_orthogonally(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s) {
    dense_columns(blocks, B, s.active, s);
    householder(s, static_cast<int>(s.columns.size()), false, 0.0);
}

void solve_orthogonally(RowSystem& s, const VecX& r, VecX& lam) {
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
}

}  // namespace pn
