// The modes that an event most often leaves: all that rests goes on resting, but for the element of the event.
//
// Where no limit depends on the load, the friction problem is convex: modes that keep their conditions solve it, and no
// others need be looked for. One evaluation tells whether they do.
#pragma once

#include "friction/stick_slip.hpp"

namespace pn {

// Tries them at (q, v), which is brought onto the rows that must hold: the element of the event sticks; if it stuck and is
// breaking, it gives way. Modes whose conditions fail are changed for a few rounds. Returns whether all conditions hold:
// then the workspace ends evaluated there, else q and v are as they were.
bool go_on(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuestion& question, int element);

}  // namespace pn
