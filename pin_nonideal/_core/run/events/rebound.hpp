// End of bouncing. Flights too low to be separated from rounding are not searched for touches. Gaps follow parabolas
// under the current acceleration and strike again. The bouncing ends if no gap approaches or leaves, or if a higher gap
// lands. The number of flights is finite: the last ones vanish in rounding. The times of the flights add up to the end of
// the accumulation. Flights with restitution 1 also end, because their energy is only rounding.
#pragma once

#include "run/events/mode_selection.hpp"

namespace pn {

struct ReboundParameters {
    // Maximum height of flights that are too low to be integrated, relative to the scene's size.
    double low_flight = 4e-12;
    int max_bounces = 10000;  // number of flights after which the bouncing is judged
    // The bouncing dies out if the second half of the flights takes less than this fraction of the time of the first half.
    // With a restitution of 1 it does not die out, and contacts that land later come to rest.
    double max_time_ratio = 0.9;
    double state_rounding = 1e-15;  // change of the state that is rounding error, relative to 1 + the largest entry
};

inline constexpr ReboundParameters rebound_parameters{};

struct Rest {
    double time = 0.0;  // time of the end [s]
    std::vector<Event> events;
    double work = 0.0;  // work of all impacts, plus other energy changes of the flights [J]
};

// Bounce from the state (t, y) just after an impact, with given modes, at most to `stop`. Return nothing if no flight
// is low. The state, its rate and the workspace are set to the end of the bouncing.
std::optional<Rest> bounce_to_rest(System& system, double t, double stop, VecX& y, VecX& dy);

}  // namespace pn
