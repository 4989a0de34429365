// Friction forces of elements at rest, all at once, in disks and balls: min f^T W f / 2 + alpha0^T f with |f_e| <= s_e, a
// second-order cone program, for elements whose directions lie one after the other (dims[e] rows each). A pure function
// on arrays.
#pragma once

#include <vector>

#include "complementarity/box_lcp.hpp"
#include "complementarity/friction_limits.hpp"

namespace pn {

VecX ball_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& s);
// The same, as a box program where every element has one direction.
VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& s,
                      const VecX* near = nullptr);
VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const FrictionLimits& limits);
// Slip accelerations a little beyond the load at which elements give way: there they are rounding, and forces of elements
// that share a load tell the directions in which all begin to move together only to its root.
VecX onset_accelerations(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const FrictionLimits& limits);

}  // namespace pn
