#include "tree/mass_factor.hpp"

#include <algorithm>
#include <cmath>

#include "tree/articulated.hpp"

namespace pn {

// Sweeps over all dofs are compiled twice, like the pass over bodies: with deep trees, and without.

template <bool some_deep>
static int factorize_rows(const Mechanism& m, Terms& terms) {
    // From the leaves to the root: row k eliminates itself from the rows of its ancestors.
    terms.L = terms.M;
    for (int k = m.nv - 1; k >= 0; --k) {
        if (some_deep && m.is_deep[k]) continue;
        const int depth = m.depth[k];
        const int* up = m.ancestors.data() + m.row_offset[k];
        double* __restrict row = terms.L.data() + m.row_offset[k];
        if (terms.locked[k]) {
            std::fill(row + 1, row + depth + 1, 0.0);
            terms.D[k] = 1.0;
            terms.inv_sqrt_D[k] = 0.0;
            continue;
        }
        for (int s = 1; s <= depth; ++s)
            if (terms.locked[up[s]]) row[s] = 0.0;
        const double pivot = row[0];
        if (!(pivot > 0.0)) return k;
        terms.D[k] = pivot;
        terms.inv_sqrt_D[k] = 1.0 / std::sqrt(pivot);
        const double inverse = 1.0 / pivot;
        int s = 1;
        for (; s < depth; s += 2) {  // two ancestors at a time, both other than row k
            const double f = row[s] * inverse, g = row[s + 1] * inverse;
            double* __restrict one = terms.L.data() + m.row_offset[up[s]];
            double* __restrict two = terms.L.data() + m.row_offset[up[s + 1]];
            one[0] -= f * row[s];
            for (int t = s + 1; t <= depth; ++t) {
                one[t - s] -= f * row[t];
                two[t - s - 1] -= g * row[t];
            }
            row[s] = f;  // entries up to s + 1 are no longer read as M
            row[s + 1] = g;
        }
        if (s == depth) {
            const double f = row[s] * inverse;
            terms.L[m.row_offset[up[s]]] -= f * row[s];
            row[s] = f;
        }
    }
    return -1;
}

int factorize(const Mechanism& m, Terms& terms) {
    if (m.deep_dofs.empty()) return factorize_rows<false>(m, terms);
    const int failed = factorize_rows<true>(m, terms);
    return failed < 0 ? factorize_articulated(m, terms) : failed;
}

template <bool some_deep>
static PN_INLINE void solve_R_rows(const Mechanism& m, const Terms& terms, VecX& x) {
    for (int k = m.nv - 1; k >= 0; --k) {
        const double xk = x[k];
        if (xk == 0.0 || (some_deep && m.is_deep[k])) continue;
        const double* row = terms.L.data() + m.row_offset[k];
        const int* up = m.ancestors.data() + m.row_offset[k];
        for (int s = 1; s <= m.depth[k]; ++s) x[up[s]] -= row[s] * xk;
        x[k] = xk * terms.inv_sqrt_D[k];  // Eq. (5)
    }
}

void solve_R(const Mechanism& m, Terms& terms, VecX& x, const Force* body) {
    if (m.deep_dofs.empty()) return solve_R_rows<false>(m, terms, x);
    solve_R_articulated(m, terms, body, x);
    solve_R_rows<true>(m, terms, x);
}

// Compute row k of R^-T x from the rows of its ancestors.
static inline void solve_Rt_row(const Mechanism& m, const Terms& terms, int k, VecX& x) {
    const double* row = terms.L.data() + m.row_offset[k];
    const int* up = m.ancestors.data() + m.row_offset[k];
    double even = x[k] * terms.inv_sqrt_D[k], odd = 0.0;
    int s = 1;
    for (; s < m.depth[k]; s += 2) {
        even -= row[s] * x[up[s]];
        odd -= row[s + 1] * x[up[s + 1]];
    }
    if (s == m.depth[k]) even -= row[s] * x[up[s]];
    x[k] = even + odd;
}

void solve_Rt(const Mechanism& m, Terms& terms, VecX& x) {
    if (m.deep_dofs.empty()) {
        for (int k = 0; k < m.nv; ++k) solve_Rt_row(m, terms, k, x);
        return;
    }
    solve_Rt_articulated(m, terms, m.deep_dofs, x);
    for (int k = 0; k < m.nv; ++k)
        if (!m.is_deep[k]) solve_Rt_row(m, terms, k, x);
}

void solve_Rt(const Mechanism& m, Terms& terms, const std::vector<int>& dofs, VecX& x) {
    if (!m.deep_dofs.empty()) solve_Rt_articulated(m, terms, dofs, x);
    for (int k : dofs)
        if (!m.is_deep[k]) solve_Rt_row(m, terms, k, x);
}

void multiply_M_locked(const Mechanism& m, Terms& terms, const VecX& x, VecX& y) {
    y.setZero();
    if (!m.deep_dofs.empty()) multiply_M_articulated(m, terms, x, nullptr, y);
    for (int k = 0; k < m.nv; ++k) {
        if (m.is_deep[k]) continue;
        const double* row = terms.M.data() + m.row_offset[k];
        const int *up = m.ancestors.data() + m.row_offset[k], depth = m.depth[k];
        const double xk = x[k];
        if (!terms.locked[k])
            for (int s = 1; s <= depth; ++s) y[up[s]] += row[s] * xk;
        else
            for (int s = 1; s <= depth; ++s) y[k] += row[s] * x[up[s]];
    }
}

void multiply_M(const Mechanism& m, Terms& terms, const VecX& x, VecX& y, Force* body) {
    y.setZero();
    if (!m.deep_dofs.empty()) multiply_M_articulated(m, terms, x, body, y);
    for (int k = 0; k < m.nv; ++k) {
        if (m.is_deep[k]) continue;
        const double* row = terms.M.data() + m.row_offset[k];
        const int* up = m.ancestors.data() + m.row_offset[k];
        y[k] += row[0] * x[k];
        for (int s = 1; s <= m.depth[k]; ++s) {
            y[k] += row[s] * x[up[s]];
            y[up[s]] += row[s] * x[k];
        }
    }
}

}  // namespace pn
