// Most frequent modes after an event: all elements at rest stay at rest, except the element of the event.
//
// If no limit depends on the load, the friction problem is convex. Modes that satisfy their conditions then solve it,
// and one evaluation checks them.
#pragma once

#include "friction/stick_slip.hpp"

namespace pn {

// Try these modes at (q, v), projected onto the required rows. The element of the event sticks, or slips if it was
// sticking and reached its limit. Modes with violated conditions are changed for a few rounds. Return true if all
// conditions hold. The workspace is then evaluated with these modes. Otherwise q and v are restored.
bool try_previous_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuestion& question,
                        int element);

}  // namespace pn
