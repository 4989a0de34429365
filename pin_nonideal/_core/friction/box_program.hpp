// Friction forces of elements of one direction, at rest, all at once: min f^T W f / 2 + alpha0^T f in the box
// |f_e| <= s_e, exactly. A pure function on arrays.
#pragma once

#include "math/spatial.hpp"

namespace pn {

// Responses below this part of the largest are none; rank_tolerance_sticking is its square root.
constexpr double rank_threshold = 1e-13;

// x of least norm with W x = r, W symmetric without negative eigenvalues; of a part of r where no x gives all of it.
VecX least_norm_solution(const MatX& W, const VecX& r);

// `near`: forces of a program like this one, whose choice of those that are at their limits is tried first.
VecX box_program(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* near = nullptr);

}  // namespace pn
