// Cosines and sines of four angles at once. Cody and Waite's reduction gives x = n pi/2 + r, with r in two numbers and
// pi/2 in three parts. Minimax polynomials of both functions apply on |r| <= pi/4. Errors stay below one unit in the
// last place. Large angles use the system's library.
#pragma once

#include <cmath>

#include "math/lanes.hpp"

namespace pn {

// Norm of four angles [rad] above which the system's library computes their cosines and sines. Below it n is exact. The
// products of n with the first two parts of pi/2 (33 bits each) are exact too.
constexpr double farthest_reduced = 8e5;

PN_INLINE void cosines_and_sines(const Lanes& x, Lanes& c, Lanes& s) {
    using Bits = long long __attribute__((vector_size(32)));
    constexpr double two_over_pi = 0x1.45f306dc9c883p-1;
    constexpr double part1 = 0x1.921fb544p+0, part2 = 0x1.0b4611a6p-34, part3 = 0x1.3198a2e037073p-69;
    constexpr double to_integer = 0x1.8p52;  // adding it puts the nearest integer into the last bits

    if (!(sum(x * x) < farthest_reduced * farthest_reduced)) {
        for (int k = 0; k < 4; ++k) {
            c[k] = std::cos(x[k]);
            s[k] = std::sin(x[k]);
        }
        return;
    }
    const Lanes shifted = x * two_over_pi + to_integer;
    const Lanes n = shifted - to_integer;
    const Lanes coarse = x - n * part1, step = n * part2, fine = coarse - step;
    const Lanes rest = n * part3 - ((coarse - fine) - step);
    const Lanes r = fine - rest, low = (fine - r) - rest;

    const Lanes z = r * r, zz = z * z;
    const Lanes p = (-0.16666666666666632 + z * 0.008333333333322425) +
                    zz * ((-0.0001984126982981709 + z * 2.755731369526191e-06) +
                          zz * (-2.5050758657127247e-08 + z * 1.5896828075046562e-10));
    const Lanes q = (0.0416666666666666 + z * -0.0013888888888874138) +
                    zz * ((2.4801587289491888e-05 + z * -2.755731435525016e-07) +
                          zz * (2.087572368463225e-09 + z * -1.1359669841303579e-11));
    const Lanes half = 0.5 * z, one_less_half = 1.0 - half;
    const Lanes sine = r + (r * z * p + low * one_less_half);
    const Lanes cosine = one_less_half + (((1.0 - one_less_half) - half) + (zz * q - r * low));

    // Quadrants: an odd n swaps cosine and sine. The second bit of n + 1 is the sign of the cosine, and that of n the
    // sign of the sine.
    const Bits quadrant = (Bits)shifted, swap = -(quadrant & 1);
    const Bits of_sine = (Bits)sine, of_cosine = (Bits)cosine;
    c = (Lanes)(((of_cosine & ~swap) | (of_sine & swap)) ^ (((quadrant + 1) & 2) << 62));
    s = (Lanes)(((of_sine & ~swap) | (of_cosine & swap)) ^ ((quadrant & 2) << 62));
}

}  // namespace pn
