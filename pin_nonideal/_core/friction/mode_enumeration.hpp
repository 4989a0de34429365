// Enumeration of all modes of a few one-dimensional elements at rest. Slow, but complete if iterations and searches
// fail.
#pragma once

#include "dynamics/workspace.hpp"
#include "friction/slip_onset.hpp"

namespace pn {

// Select the only modes whose motion satisfies their own conditions. Among several select the modes in which every
// element sticks that sticks in any other. Return false if no tried modes satisfy them but other choices may have a
// motion. Throw a paradox if no motion exists, or if no motion has all the sticking elements of the others. On return
// the workspace holds the selected motion.
bool enumerate_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuery& query);

}  // namespace pn
