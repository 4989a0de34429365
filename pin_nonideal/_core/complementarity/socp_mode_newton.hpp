// Friction forces of elements at rest, all at once, in disks and balls: minimize f^T W f / 2 + alpha0^T f with |f_e| <=
// s_e. This is a second-order cone program. The directions of the elements lie in sequence (dims[e] rows each). Pure
// functions on arrays.
#pragma once

#include <vector>

#include "complementarity/box_lcp.hpp"
#include "complementarity/friction_limits.hpp"

namespace pn {

struct SocpParameters {
    int max_steps = 60;        // maximum steps of the interior-point method
    int max_mode_newton = 12;  // maximum Newton steps for fixed modes
    // Largest z . y of a solution, relative to the acceleration scale. Rounding may end the iteration earlier.
    double gap_tolerance = 1e-17;
    double mode_newton_tolerance = 4e-16;  // relative error of the forces: two units of roundoff
    double condition_slack = 1e-12;        // violation of a mode's condition that is rounding error, relative to a limit
};

inline constexpr SocpParameters socp_parameters{};

VecX ball_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& s);
// Solve the ball program, or a box program if every element has one direction. Only the box program uses `initial`, the
// forces of a similar program.
VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& s,
                      const VecX* initial = nullptr);
VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const FrictionLimits& limits,
                      const VecX* initial = nullptr);
// Return slip accelerations slightly beyond the load of slip onset. At onset the slip accelerations are rounding error. If
// elements share a load, their forces give the directions of a common slip only to the square root of the rounding error.
VecX onset_accelerations(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const FrictionLimits& limits);

}  // namespace pn
