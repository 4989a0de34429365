// What happens at an event of stick and slip: new modes for all elements at rest together.
#pragma once

#include <optional>
#include <vector>

#include "run/events/event_location.hpp"
#include "run/output/recorder.hpp"

namespace pn {

// New modes at (t, y), which is brought onto the constraints; without an event, as at the start of a run, for every
// element by its velocity. The workspace ends evaluated there, with the rate in dy. Returns what has changed, nothing
// where there was no event.
std::vector<Event> switch_modes(System& system, double t, VecX& y, VecX& dy, const std::optional<FoundEvent>& event);

// What has changed between modes before and now: contacts that open or close, then elements that stick or slip, and one
// that has `turned`.
std::vector<Event> changes_since(const System& system, double t, const std::vector<char>& closed,
                                 const std::vector<Mode>& before, int turned = -1);

// Whether contacts strike at (t, y): they touch and approach each other.
bool contacts_strike(System& system, double t, const VecX& y, bool starts);
// Whether one of them is open as yet: it lands where something else happens.
bool contacts_land(System& system, double t, const VecX& y);
// Their impact, which changes the velocity: an event a contact with an impulse, the work of these, and that of moving
// constraints.
struct Strike {
    std::vector<Event> events;
    double work = 0.0, work_of_constraints = 0.0;
};
Strike strike_contacts(System& system, double t, VecX& y, bool starts, bool bounces = true);

// Whether some element of several directions slips.
bool turning(const System& system);

// Kind of the event in which the mode of an element changes so.
Event::Kind kind_of_change(Mode before, Mode after);

// Keeps the slip directions at a step's end for the next step; the slip speeds go into `slip`. The slip that is left of an
// element that has `arrived` at rest is an error of the step: this slip, and slower slip, does not change its direction.
void remember_directions(System& system, std::vector<double>& slip, int arrived = -1);

}  // namespace pn
