// The end of bouncing. Flights too low to be told from rounding are not searched for touches: gaps fly as parabolas under
// the acceleration at hand, and strike again, until none of them approaches or leaves any more, or one that flies higher
// lands. Their number is finite, the last ones are lost in rounding, and the instants add up to the limit of the
// accumulation. Flights that do not die out, with restitution of 1, end as well: what they hold is no more than rounding.
#pragma once

#include "run/events/events.hpp"

namespace pn {

struct Rest {
    double time = 0.0;  // of the end
    std::vector<Event> events;
    double work = 0.0;  // of all impacts, and what the flights change of the energy beside
};

// From the state (t, y) just behind an impact, whose modes are known, not beyond `stop`; nothing where no flight is low.
// The state, its rate and the workspace become those of the end.
std::optional<Rest> bounce_to_rest(System& system, double t, double stop, VecX& y, VecX& dy);

}  // namespace pn
