// Location of events that no single margin shows: redundant elements that begin to slip together, and redundant contacts
// that lift off together. Such elements hold as long as some forces within all limits and cones hold.
#pragma once

#include <optional>
#include <vector>

#include "friction/mode_query.hpp"
#include "run/events/found_event.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

struct ReleaseLocationParameters {
    double time_tolerance = 1e-12;  // tolerance of the instant, relative to the step or the time
    double max_rate_ratio = 0.7;    // maximum ratio of two rates for which their secant is used
    double short_of_root = 1e-2;    // distance kept from the root of the secant, relative to the distance to it
    int asks_before_start = 3;       // places that release the elements before the search tries the step's start
    // Extension of a repeated step that does not show the release of its interpolant. The first extension is relative
    // to the step, and each further one is longer by a factor.
    double min_extension = 1e-11, further_part = 10.0;
    int places_inside = 8;  // intervals of a step at rest, at whose ends sticking elements are checked
};

class ReleaseLocator {
public:
    using Parameters = ReleaseLocationParameters;
    static constexpr Parameters parameters{};

    ReleaseLocator(System& system, Stepper& stepper) : system_(system), stepper_(stepper), p(system.p), w(system.w) {}

    // End the step just taken at the release of redundant sticking elements, if they slip at its end.
    std::optional<FoundEvent> release_together();
    // End the step just taken at the lift-off of redundant contacts, if no nonnegative loads exist at its end.
    std::optional<FoundEvent> lift_together();

private:
    bool shares_hold_at(double t);
    std::optional<double> release_rate(double t, const VecX& y, const std::vector<Mode>& modes, ModeQuery& mode_query);
    std::optional<double> release_rate_at_end(const std::vector<Mode>& modes, ModeQuery& mode_query);
    double release_part(double rate, const std::vector<Mode>& modes, ModeQuery& mode_query);
    std::optional<double> release_rate_inside(const std::vector<Mode>& modes, ModeQuery& mode_query);
    bool all_press();

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
};

}  // namespace pn
