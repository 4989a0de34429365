// Most frequent modes after an event: all elements at rest stay at rest, except the element of the event.
//
// If no limit depends on the load, the friction problem is convex. Modes that satisfy their conditions then solve it,
// and one evaluation checks them.
#pragma once

#include "friction/stick_slip.hpp"

namespace pn {

struct ModeUpdateParameters {
    // Sticking removes slip of rounding. At a dead center of a loop, slip reverses while other bodies move, and its
    // removal could stop the whole motion. A relative change of the velocity above this value is a change of the
    // motion.
    double min_velocity_change = 1e-6;
    double condition_slack = 1e-9;  // rounding relative to the limit, or to the scale of accelerations
    int max_rounds = 6;             // rounds of mode changes before the full problem is solved
};

inline constexpr ModeUpdateParameters mode_update_parameters{};

// Try these modes at (q, v), projected onto the required rows. The element of the event sticks, or slips if it was
// sticking and reached its limit. Modes with violated conditions are changed for a few rounds. Return true if all
// conditions hold. The workspace is then evaluated with these modes. Otherwise q and v are restored.
bool try_previous_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuery& query,
                        int element);

}  // namespace pn
