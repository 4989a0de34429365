// Stick-slip modes. With the forces f of all elements at rest as unknowns, their slip accelerations are alpha = alpha0
// + W f (problem.hpp). Friction opposes slip within its limits: |f| <= s, and f = -s alpha / |alpha| if alpha is
// nonzero. For given limits this is a convex program in a box, or a disk or ball for elements of several directions.
// All elements are solved at once. An outer iteration updates load-dependent limits.
#pragma once

#include "friction/slip_onset.hpp"

namespace pn {

// Compute the modes of all elements at rest. The workspace is evaluated with the new modes on return.
void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuestion& question);

}  // namespace pn
