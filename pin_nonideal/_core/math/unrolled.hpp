// Loops over the rows of a block, whose number is one of a few.
#pragma once

#include <type_traits>

namespace pn {

constexpr int tile = 6;  // rows of an anchor at most

// Calls f with n, 1 to tile, as a constant of the type: loops of a length known to the compiler cost half.
template <int n = 1, class F>
inline void with_constant(int value, F&& f) {
    if constexpr (n < tile) {
        if (value != n) return with_constant<n + 1>(value, f);
    }
    f(std::integral_constant<int, n>());
}

// The same for any number of rows: f gets a plain int for more than a tile.
template <class F>
inline void with_rows(int value, F&& f) {
    if (value <= tile) with_constant(value, f);
    else f(value);
}

}  // namespace pn
