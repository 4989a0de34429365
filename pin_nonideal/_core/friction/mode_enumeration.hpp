// Enumeration of all modes of a few one-dimensional elements at rest. Slow, but complete if iterations and searches
// fail.
#pragma once

#include "dynamics/workspace.hpp"
#include "friction/slip_onset.hpp"

namespace pn {

// Select the modes whose conditions hold in their own motion. Of several choices, select the one that contains the sticking
// elements of every choice. Return false if no tried choice has a motion, but untried choices may have one. Throw a paradox
// if no motion exists, or if no choice contains all these sticking elements. On return the workspace holds the selected
// motion.
bool enumerate_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuery& query);

}  // namespace pn
