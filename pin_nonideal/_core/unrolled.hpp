// Short loops: over the rows of a block, whose number is one of a few, and over the entries that two rows share.
#pragma once

#include <type_traits>

namespace pn {

constexpr int tile = 6;  // rows of an anchor at most

// Calls f with n, 1 to tile, as a constant of the type: loops of a length known to the compiler cost half.
template <int n = tile, class F>
inline void with_constant(int value, F&& f) {
    if constexpr (n > 1) {
        if (value != n) return with_constant<n - 1>(value, f);
    }
    f(std::integral_constant<int, n>());
}

// The same for any number of rows: f gets a plain int for more than a tile.
template <class F>
inline void with_rows(int value, F&& f) {
    if (value <= tile) with_constant(value, f);
    else f(value);
}

// Four sums side by side, so that none waits for the one before.
inline double dot(const double* x, const double* y, int n) {
    double a = 0.0, b = 0.0, c = 0.0, d = 0.0;
    int k = 0;
    for (; k + 3 < n; k += 4) {
        a += x[k] * y[k];
        b += x[k + 1] * y[k + 1];
        c += x[k + 2] * y[k + 2];
        d += x[k + 3] * y[k + 3];
    }
    for (; k < n; ++k) a += x[k] * y[k];
    return (a + b) + (c + d);
}

}  // namespace pn
