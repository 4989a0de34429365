// Loops over the rows of a block, unrolled for small numbers of rows.
#pragma once

#include <type_traits>

namespace pn {

constexpr int tile = 6;  // maximum number of rows of an anchor

// Call f with n (1 to `tile`) as a compile-time constant. Loops of known length cost half.
template <int n = 1, class F>
inline void with_constant(int value, F&& f) {
    if constexpr (n < tile) {
        if (value != n) return with_constant<n + 1>(value, f);
    }
    f(std::integral_constant<int, n>());
}

// Call f with any number of rows. f receives a plain int for more rows than `tile`.
template <class F>
inline void with_rows(int value, F&& f) {
    if (value <= tile) with_constant(value, f);
    else f(value);
}

}  // namespace pn
