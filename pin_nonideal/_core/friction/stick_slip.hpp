// Stick-slip modes. With the forces f of all elements at rest as unknowns, their slip accelerations are alpha = alpha0
// + W f (problem.hpp). Friction opposes slip within its limits: |f| <= s, and f = -s alpha / |alpha| if alpha is
// nonzero. For given limits this is a convex program in a box, or a disk or ball for elements of several directions.
// All elements are solved at once. An outer iteration updates load-dependent limits.
#pragma once

#include <limits>

#include "friction/slip_onset.hpp"

namespace pn {

struct StickSlipParameters {
    double limit_tolerance = 1e-12;  // relative change of the limits at convergence
    // Change of a limit that counts as rounding error, relative to the largest given force. A limit in a part of a long
    // chain without large loads may be as small as this rounding error.
    double limit_force_rounding = 64 * std::numeric_limits<double>::epsilon();
    int max_limit_iterations = 100;  // maximum iterations of forces and limits
    // Deviation of a slip's acceleration from the direction of its friction (1 - cosine) that counts as rounding error.
    double max_direction_deviation = 1e-10;
    double settled_direction = 1e-11;  // turn of a slip direction that counts as rounding error [rad]
    int max_turns = 20;                // maximum iterations of the directions of a nearby motion
};

inline constexpr StickSlipParameters stick_slip_parameters{};

// Decide if each element at rest sticks or slips, and in which direction. The elements at rest include elements that have
// just come to rest. On return the workspace is evaluated with the new modes.
void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuery& query);

}  // namespace pn
