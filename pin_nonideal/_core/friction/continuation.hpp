// The modes that an event most often leaves: all that rests goes on resting, but for the element of the event.
//
// Where no limit depends on the load, the friction problem is convex: modes that keep their conditions solve it, and no
// others need be looked for. One evaluation tells.
#pragma once

#include "friction/modes.hpp"

namespace pn {

// Tries them at (q, v), which is brought onto the rows that must hold: the element of the event sticks, or turns where
// that does not hold; if it stuck and is breaking, it gives way. Returns whether they keep their conditions: then the
// workspace ends evaluated there, else q and v are as they were.
bool go_on(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuestion& question, int element);

}  // namespace pn
