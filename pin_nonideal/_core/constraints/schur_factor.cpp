#include "constraints/schur_factor.hpp"

#include <algorithm>
#include <cmath>

#include "constraints/qr_factor.hpp"
#include "constraints/rank_parameters.hpp"
#include "math/lanes.hpp"
#include "math/unrolled.hpp"

namespace pn {

// Compute the entries of G = B B^T below the diagonal for n1 rows of one block, from position p1, and n2 rows of
// another, from p2. The sum runs over their common dofs.
template <int n1, int n2>
static void multiply_tile(const double* X, int r1, const double* Y, int r2, const CommonDofs& common,
                          const Envelope& envelope, int p1, int p2, double* G) {
    double sum[n1][n2] = {};
    for (const auto& [l, k] : common) {
        const double *x = X + l * r1, *y = Y + k * r2;
        for (int i = 0; i < n1; ++i)
            for (int j = 0; j < n2; ++j) sum[i][j] += x[i] * y[j];
    }
    for (int i = 0; i < n1; ++i) {
        double* row = G + envelope.start[p1 + i] + p2;
        const int end = p1 + i - p2;  // the diagonal
        for (int j = 0; j < n2; ++j)
            if (j <= end) row[j] = sum[i][j];
    }
}

// Multiply the rows of two blocks, one tile at a time. The rows of a block are adjacent in the layout, and rows of the
// first block never precede rows of the second.
static PN_INLINE void multiply_blocks(const Block& b1, const Block& b2, const CommonDofs& common,
                                      const RowEntries& B, RowSystem& s) {
    const int r1 = static_cast<int>(b1.kept.size()), r2 = static_cast<int>(b2.kept.size());
    const double *X = B.data() + b1.offset, *Y = B.data() + b2.offset;
    for (int i0 = 0; i0 < r1; i0 += tile)
        for (int j0 = 0; j0 < r2; j0 += tile) {
            const int p1 = s.envelope.position[b1.row] + i0, p2 = s.envelope.position[b2.row] + j0;
            with_constant(std::min(tile, r1 - i0), [&](auto n1) {
                with_constant(std::min(tile, r2 - j0), [&](auto n2) {
                    multiply_tile<n1, n2>(X + i0, r1, Y + j0, r2, common, s.envelope, p1, p2, s.G.data());
                });
            });
        }
}

void delassus(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s) {
    for (const auto& [block, other, common] : s.envelope.pairs)
        multiply_blocks(blocks[block], blocks[other], s.envelope.common(common), B, s);
}

void scale_to_unit_length(const std::vector<char>& use, RowSystem& s) {
    const Envelope& envelope = s.envelope;
    for (int i = 0; i < envelope.size(); ++i) {
        const int row = envelope.row_at[i];
        if (!use[row]) continue;
        const double square = s.G[envelope.start[i] + i];
        s.scale[row] = square > 0.0 ? 1.0 / std::sqrt(square) : 1.0;
    }
}

// Return the least ratio of a row's squared length to that of the longest row of its block, among blocks with comparable
// rows. Set `vanishes` if a row of any block is so much shorter than another row that it is rounding error.
static PN_INLINE double shortest_row(const std::vector<Block>& blocks, const RowSystem& s, bool& vanishes) {
    double shortest = 1.0;
    for (int index : s.blocks) {
        const Block& block = blocks[index];
        double min_square = HUGE_VAL, max_square = 0.0;
        for (size_t k = 0; k < block.kept.size(); ++k) {
            if (!s.active[block.row + k]) continue;
            const int i = s.envelope.position[block.row + k];
            const double square = s.G[s.envelope.start[i] + i];
            min_square = std::min(min_square, square);
            max_square = std::max(max_square, square);
        }
        vanishes |= min_square < rank_parameters.vanishing_square * max_square;
        if (block.comparable_rows && min_square < shortest * max_square) shortest = min_square / max_square;
    }
    return shortest;
}

// Return the least ratio of an active row's squared length to its greatest squared length in these modes. Used if other rows
// depend on the active ones.
static double shortest_passing(const RowSystem& s) {
    const Envelope& envelope = s.envelope;
    double shortest = 1.0;
    for (int i = 0; i < envelope.size(); ++i) {
        const int row = envelope.row_at[i];
        const double square = s.G[envelope.start[i] + i];
        if (s.active[row] && square < shortest * s.longest[row]) shortest = square / s.longest[row];
    }
    return shortest;
}

// Compute the Cholesky factor of the unit-diagonal B B^T inside the envelope. Return true if its pivots are safe.
static PN_INLINE bool factor_cholesky(RowSystem& s) {
    const Envelope& envelope = s.envelope;
    double* L = s.factor.data();
    for (int i = 0; i < envelope.size(); ++i) {
        const int row = envelope.row_at[i];
        if (!s.active[row]) continue;
        double* Li = L + envelope.start[i];
        const double* Gi = s.G.data() + envelope.start[i];
        const int first = envelope.first[i];
        const double scale = s.scale[row];
        double pivot = Gi[i] > 0.0 ? 1.0 : 0.0;  // zero row: its dofs are locked
        for (int j = first; j < i; ++j) {
            const int column = envelope.row_at[j];
            if (!s.active[column]) { Li[j] = 0.0; continue; }
            const double* Lj = L + envelope.start[j];
            const int common = std::max(first, envelope.first[j]);
            const double sum = Gi[j] * scale * s.scale[column] - dot(Li + common, Lj + common, j - common);
            Li[j] = sum * Lj[j];  // the diagonal holds inverse roots of pivots
            pivot -= Li[j] * Li[j];
        }
        s.min_pivot = std::min(s.min_pivot, pivot);
        if (!(pivot >= rank_parameters.min_schur_pivot)) return false;
        Li[i] = 1.0 / std::sqrt(pivot);
    }
    return true;
}

PN_WIDE void factor_rows(const std::vector<Block>& blocks, const RowEntries& B, RowSystem& s) {
    ++s.factorization;
    delassus(blocks, B, s);
    scale_to_unit_length(s.active, s);
    s.min_pivot = 1.0;
    bool vanishes = false;
    const double shortest = shortest_row(blocks, s, vanishes);
    s.orthogonal = !factor_cholesky(s) || vanishes;
    s.distance = std::min(shortest, s.min_pivot);
    if (s.redundant) s.distance = std::min(s.distance, shortest_passing(s));
    if (s.orthogonal) factor_orthogonally(blocks, B, s);
}

void solve_rows(RowSystem& s, const VecX& r, VecX& lam) {
    lam.setZero();
    solve_active_rows(s, r, lam);
}

PN_WIDE void solve_active_rows(RowSystem& s, const VecX& r, VecX& lam) {
    if (s.orthogonal) return solve_orthogonally(s, r, lam);
    const Envelope& envelope = s.envelope;
    const double* L = s.factor.data();
    double* __restrict y = s.work.data();
    for (int i = 0; i < envelope.size(); ++i) {
        const int row = envelope.row_at[i], first = envelope.first[i];
        const double* Li = L + envelope.start[i];
        y[i] = 0.0;
        if (s.active[row]) y[i] = (r[row] * s.scale[row] - dot(Li + first, y + first, i - first)) * Li[i];
    }
    for (int i = envelope.size() - 1; i >= 0; --i) {
        const int row = envelope.row_at[i];
        if (!s.active[row]) continue;
        const double* Li = L + envelope.start[i];
        const double yi = y[i] * Li[i];
        for (int j = envelope.first[i]; j < i; ++j) y[j] -= Li[j] * yi;
        lam[row] = yi * s.scale[row];
    }
}

}  // namespace pn
