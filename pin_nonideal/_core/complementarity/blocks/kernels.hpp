// Dense kernels on small matrices stored in row-major order. Blocks of six, the free bodies, have loops of fixed length.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "math/lanes.hpp"

namespace pn {

// Pivots whose multiples leave the remaining rows of a large matrix together. A row is then read once for all of them.
constexpr int panel = 4;

// Subtract from x the first `n` numbers of four rows, `stride` apart, times f[0] ... f[3].
PN_INLINE void subtract_panel(double* __restrict x, const double* f, const double* __restrict rows, int stride, int n) {
    const double *__restrict a = rows, *__restrict b = a + stride, *__restrict c = b + stride, *__restrict d = c + stride;
    const double fa = f[0], fb = f[1], fc = f[2], fd = f[3];
    for (int j = 0; j < n; ++j) x[j] = (((x[j] - fa * a[j]) - fb * b[j]) - fc * c[j]) - fd * d[j];
}

// A := its lower Cholesky factor, with inverse pivots on the diagonal. The upper triangle receives the transpose of the
// factor. Returns false if a pivot is not positive.
PN_INLINE bool cholesky(double* A, int n) {
    for (int first = 0; first < n; first += panel) {
        const int end = std::min(first + panel, n);
        for (int p = first; p < end; ++p) {
            double* __restrict row = A + p * n;
            if (!(row[p] > 0.0) || !(row[p] < HUGE_VAL)) return false;
            const double inverse = row[p] = 1.0 / std::sqrt(row[p]);
            for (int i = p + 1; i < n; ++i) row[i] = A[i * n + p] *= inverse;
            for (int q = p + 1; q < end; ++q)
                for (int i = q; i < n; ++i) A[i * n + q] -= row[q] * row[i];
        }
        for (int i = end; i < n; ++i)
            subtract_panel(A + i * n + end, A + i * n + first, A + first * n + end, n, i - end + 1);
    }
    return true;
}

// x := L^-1 x and x := L^-T x.
template <int N = 0>
PN_INLINE void solve_lower(const double* L, int n, double* x) {
    if (N) n = N;
    for (int i = 0; i < n; ++i) {
        double sum = x[i];
        for (int k = 0; k < i; ++k) sum -= L[i * n + k] * x[k];
        x[i] = sum * L[i * n + i];
    }
}
template <int N = 0>
PN_INLINE void solve_lower_transpose(const double* L, int n, double* x) {
    if (N) n = N;
    for (int i = n - 1; i >= 0; --i) {
        x[i] *= L[i * n + i];
        for (int k = 0; k < i; ++k) x[k] -= L[i * n + k] * x[i];
    }
}

// y += A x and y += A^T x, with A (m, n).
template <int N = 0>
PN_INLINE void add_product(const double* A, int m, int n, const double* x, double* y) {
    if (N) n = N;
    for (int k = 0; k < m; ++k, A += n) {
        double sum = 0.0;
        for (int i = 0; i < n; ++i) sum += A[i] * x[i];
        y[k] += sum;
    }
}
template <int N = 0>
PN_INLINE void add_transpose(const double* A, int m, int n, const double* x, double* y) {
    if (N) n = N;
    for (int k = 0; k < m; ++k, A += n)
        for (int i = 0; i < n; ++i) y[i] += A[i] * x[k];
}

// X := L^-1 X for X of n rows and m columns.
PN_INLINE void solve_lower_columns(const double* L, int n, double* X, int m) {
    for (int i = 0; i < n; ++i) {
        for (int l = 0; l < i; ++l) {
            const double a = L[i * n + l];
            for (int c = 0; c < m; ++c) X[i * m + c] -= a * X[l * m + c];
        }
        for (int c = 0; c < m; ++c) X[i * m + c] *= L[i * n + i];
    }
}

// C -= A B, with A (m, k) and B (k, n).
PN_INLINE void subtract_product(double* C, const double* A, const double* B, int m, int k, int n) {
    for (int i = 0; i < m; ++i)
        for (int l = 0; l < k; ++l) {
            const double a = A[i * k + l];
            for (int j = 0; j < n; ++j) C[i * n + j] -= a * B[l * n + j];
        }
}

// C -= A^T B, with A (k, m) and B (k, n).
PN_INLINE void subtract_transpose_product(double* C, const double* A, const double* B, int m, int k, int n) {
    for (int l = 0; l < k; ++l)
        for (int i = 0; i < m; ++i) {
            const double a = A[l * m + i];
            for (int j = 0; j < n; ++j) C[i * n + j] -= a * B[l * n + j];
        }
}

// K := G J, with G (3, 3) and J (3, N).
template <int N>
PN_INLINE void multiply_three(const double* G, const double* J, double* K) {
    for (int r = 0; r < 3; ++r)
        for (int k = 0; k < N; ++k)
            K[r * N + k] = G[3 * r] * J[k] + G[3 * r + 1] * J[N + k] + G[3 * r + 2] * J[2 * N + k];
}

// C += A^T B, with A (k, m) and B (k, n). Rows of contacts on a long tree end with zeros, for the links beyond the contact.
template <int N = 0>
PN_INLINE void add_transpose_product(double* C, const double* A, const double* B, int k, int m, int n) {
    if (N) m = n = N;
    for (int l = 0; l < k; ++l) {
        int end = n;
        while (!N && end > 0 && B[l * n + end - 1] == 0.0) --end;
        for (int i = 0; i < m; ++i) {
            const double a = A[l * m + i];
            if (!N && a == 0.0) continue;
            for (int j = 0; j < end; ++j) C[i * n + j] += a * B[l * n + j];
        }
    }
}

// A row of six numbers.
struct SixLanes {
    Lanes front;
    TwoLanes back;

    SixLanes() = default;
    PN_INLINE explicit SixLanes(const double* from) {
        load(from, front);
        load(from + 4, back);
    }
    PN_INLINE void store_to(double* to) const {
        store(front, to);
        store(back, to + 4);
    }
    PN_INLINE void scale(double a) {
        front *= a;
        back *= a;
    }
    PN_INLINE void add(double a, const SixLanes& b) {
        front += a * b.front;
        back += a * b.back;
    }
    PN_INLINE void subtract(double a, const SixLanes& b) {
        front -= a * b.front;
        back -= a * b.back;
    }
};

// C += A^T B, with A (3, 6) and B (3, 6).
PN_INLINE void add_three_by_six(double* C, const double* A, const double* B) {
    const SixLanes b[3] = {SixLanes(B), SixLanes(B + 6), SixLanes(B + 12)};
    for (int i = 0; i < 6; ++i, C += 6) {
        SixLanes c(C);
        for (int l = 0; l < 3; ++l) c.add(A[6 * l + i], b[l]);
        c.store_to(C);
    }
}

// C -= A B, or C -= A^T B, with six rows and columns each.
template <bool transposed>
PN_INLINE void subtract_six(double* C, const double* A, const double* B) {
    const SixLanes b[6] = {SixLanes(B),      SixLanes(B + 6),  SixLanes(B + 12),
                           SixLanes(B + 18), SixLanes(B + 24), SixLanes(B + 30)};
    for (int i = 0; i < 6; ++i, C += 6) {
        SixLanes c(C);
        for (int l = 0; l < 6; ++l) c.subtract(transposed ? A[6 * l + i] : A[6 * i + l], b[l]);
        c.store_to(C);
    }
}

// Factor A = P L U in place with exchanges of rows. Returns false if a pivot is zero. `many`: pivots of a panel.
template <int many = 1>
PN_INLINE bool eliminate(double* A, int* exchanges, int n) {
    for (int first = 0; first < n; first += many) {
        const int end = std::min(first + many, n);
        for (int c = first; c < end; ++c) {
            int best = c;
            for (int i = c + 1; i < n; ++i)
                if (std::abs(A[i * n + c]) > std::abs(A[best * n + c])) best = i;
            exchanges[c] = best;
            if (best != c)
                for (int j = 0; j < n; ++j) std::swap(A[best * n + j], A[c * n + j]);
            if (!(std::abs(A[c * n + c]) > 0.0) || !(std::abs(A[c * n + c]) < HUGE_VAL)) return false;
            const double inverse = 1.0 / A[c * n + c];
            for (int i = c + 1; i < n; ++i) {
                const double factor = A[i * n + c] *= inverse;
                for (int j = c + 1; j < (many == 1 ? n : end); ++j) A[i * n + j] -= factor * A[c * n + j];
            }
        }
        if (many == 1) continue;
        for (int i = first + 1; i < end; ++i)
            for (int l = first; l < i; ++l)
                for (int j = end; j < n; ++j) A[i * n + j] -= A[i * n + l] * A[l * n + j];
        for (int i = end; i < n; ++i) subtract_panel(A + i * n + end, A + i * n + first, A + first * n + end, n, n - end);
    }
    return true;
}

// X := A^-1 X for X of m columns, with the factors of eliminate.
PN_INLINE void substitute(const double* A, const int* exchanges, int n, double* X, int m) {
    for (int c = 0; c < n; ++c)
        if (exchanges[c] != c)
            for (int j = 0; j < m; ++j) std::swap(X[c * m + j], X[exchanges[c] * m + j]);
    for (int i = 1; i < n; ++i)
        for (int l = 0; l < i; ++l) {
            const double a = A[i * n + l];
            for (int j = 0; j < m; ++j) X[i * m + j] -= a * X[l * m + j];
        }
    for (int i = n - 1; i >= 0; --i) {
        for (int l = i + 1; l < n; ++l) {
            const double a = A[i * n + l];
            for (int j = 0; j < m; ++j) X[i * m + j] -= a * X[l * m + j];
        }
        const double inverse = 1.0 / A[i * n + i];
        for (int j = 0; j < m; ++j) X[i * m + j] *= inverse;
    }
}

// X := L^-1 X, or X := A^-1 X with the factors of eliminate, for six rows and columns.
PN_INLINE void solve_lower_six(const double* L, double* X) {
    SixLanes x[6];
    for (int i = 0; i < 6; ++i) {
        x[i] = SixLanes(X + 6 * i);
        for (int l = 0; l < i; ++l) x[i].subtract(L[6 * i + l], x[l]);
        x[i].scale(L[7 * i]);
        x[i].store_to(X + 6 * i);
    }
}
PN_INLINE void substitute_six(const double* A, const int* exchanges, double* X) {
    for (int c = 0; c < 6; ++c)
        if (exchanges[c] != c)
            for (int j = 0; j < 6; ++j) std::swap(X[6 * c + j], X[6 * exchanges[c] + j]);
    SixLanes x[6];
    for (int i = 0; i < 6; ++i) {
        x[i] = SixLanes(X + 6 * i);
        for (int l = 0; l < i; ++l) x[i].subtract(A[6 * i + l], x[l]);
    }
    for (int i = 5; i >= 0; --i) {
        for (int l = i + 1; l < 6; ++l) x[i].subtract(A[6 * i + l], x[l]);
        x[i].scale(1.0 / A[7 * i]);
        x[i].store_to(X + 6 * i);
    }
}

}  // namespace pn
