// All choices of modes of a few elements at rest that slip along one direction each, one after the other: slow, and sure
// where turns and searches of forces and limits together come to nothing.
#pragma once

#include "dynamics/workspace.hpp"
#include "friction/slip_onset.hpp"

namespace pn {

// Of a few such elements takes the only choice whose motion keeps the conditions of its modes, or of several the one in
// which all sticks that sticks in any other; false where there is none, but some choice might have another motion. Throws
// a paradox where it is shown that there is none, or of several none holds the most. Leaves the workspace in that motion.
bool take_only_choice(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const ModeQuestion& question);

}  // namespace pn
