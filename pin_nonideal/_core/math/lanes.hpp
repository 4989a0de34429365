// Four numbers at a time. Functions marked PN_WIDE are compiled twice. On a processor with registers of four numbers (AVX2)
// the loader selects the version that uses them. Neither version fuses products and sums, so both give the same numbers.
#pragma once

#include <cstring>

#if defined(PN_HAS_CLONES)
#define PN_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define PN_WIDE
#endif
// Functions called by a wide function must be inlined into it.
#define PN_INLINE inline __attribute__((always_inline))

namespace pn {

using Lanes = double __attribute__((vector_size(32)));

using TwoLanes = double __attribute__((vector_size(16)));

template <class Several>
PN_INLINE void load(const double* from, Several& x) { std::memcpy(&x, from, sizeof x); }
template <class Several>
PN_INLINE void store(const Several& x, double* to) { std::memcpy(to, &x, sizeof x); }

PN_INLINE double sum(const Lanes& x) { return (x[0] + x[2]) + (x[1] + x[3]); }

// Return the dot product from four independent partial sums, so that no addition waits for the previous one.
PN_INLINE double dot(const double* x, const double* y, int n) {
    Lanes sums = {};
    int k = 0;
    for (; k + 3 < n; k += 4) {
        Lanes a, b;
        load(x + k, a);
        load(y + k, b);
        sums += a * b;
    }
    double rest = 0.0;
    for (; k < n; ++k) rest += x[k] * y[k];
    return sum(sums) + rest;
}

}  // namespace pn
