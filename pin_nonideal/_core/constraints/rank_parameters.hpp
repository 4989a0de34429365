// Thresholds of the choice of independent rows: their lengths, pivots and factors.
#pragma once

namespace pn {

struct RankParameters {
    // Minimum of a squared length, or of the smallest pivot, relative to its largest value, without a new choice of rows.
    double faded_part = 0.1;
    // Smallest trusted pivot of the Cholesky factor of the unit-diagonal B B^T. The relative error of the factor stays
    // below the machine precision divided by this value. Below it the orthogonal factorization of B^T is used.
    double min_schur_pivot = 1e-5;
    // Smallest sine of the angle to other rows with which a row of a permanent constraint is certainly independent. Such
    // rows are chosen before rows of contacts and friction.
    double clear_pivot = 1e-2;
    // Largest squared length of a row that is rounding error, relative to the longest row of its block.
    double vanishing_square = 1e-28;
    // Relative difference of squared lengths below which two columns tie. The earlier column then goes first, so that
    // rounding does not choose among equal rows.
    double tie = 1e-12;
    // Row length that may be rounding error, relative to the row of a force that moves the whole mass. For example, a force
    // through the only pin of a body moves nothing at any position of the pin.
    double min_length_part = 1e-4;
    // Lower bound on the length of a row of a user's function, as a fraction of the longest row. Rounding error of a
    // direction without freedom is far shorter, and rows in other units are longer.
    double min_function_length_part = 1e-4;
};

inline constexpr RankParameters rank_parameters{};

}  // namespace pn
