// Mode switches at events of stick and slip: new modes for all elements at rest together.
#pragma once

#include <optional>
#include <vector>

#include "run/events/event_location.hpp"
#include "run/output/recorder.hpp"

namespace pn {

struct ModeSelectionParameters {
    // Minimum slip speed [rad/s or m/s] that defines a slip direction.
    double directed_slip = 1e-12;
    // Rounding tolerance of the limit of a sticking element, relative to the limit.
    double limit_rounding = 1e-9;
};

inline constexpr ModeSelectionParameters mode_selection_parameters{};

// Select new modes at (t, y), and project y onto the constraints. Without an event, as at the start of a run, every
// element gets its mode from its velocity. On return the workspace is evaluated at (t, y), and dy holds the rate.
// Return the changes, empty without an event.
//
// The contacts of two bodies open if none has a load at a lift, or at the touch of an opened contact. `released` receives
// their gaps.
std::vector<Event> switch_modes(System& system, double t, VecX& y, VecX& dy, const std::optional<FoundEvent>& event,
                                std::vector<int>* released = nullptr);

// Return the changes of modes since `before`. Contacts that open or close come first, then elements that stick or slip.
// The element `turned` has reversed.
std::vector<Event> changes_since(const System& system, double t, const std::vector<char>& closed,
                                 const std::vector<Mode>& before, int turned = -1);

// Check if contacts strike at (t, y): they touch and approach each other.
bool contacts_strike(System& system, double t, const VecX& y, bool starts);
// Check if an open contact touches and approaches at (t, y), for events other than touches.
bool contacts_land(System& system, double t, const VecX& y);
// Impact of contacts, which changes the velocity: one event per contact with an impulse, work of the contacts [J], and
// work of moving constraints [J].
struct Strike {
    std::vector<Event> events;
    double work = 0.0, work_of_constraints = 0.0;
};
Strike strike_contacts(System& system, double t, VecX& y, bool starts, bool bounces = true);

// Check if an element with several directions slips.
bool has_turning_slip(const System& system);

// Return the kind of event for a change of an element's mode.
Event::Kind kind_of_change(Mode before, Mode after);

// Store the slip directions at a step's end for the next step, and the slip speeds in `slip`. `stopped_element`:
// element that came to rest at the step's end. The remaining slip speed of this element is an error of the step, so elements
// with lower slip speeds keep their directions.
void remember_directions(System& system, std::vector<double>& slip, int stopped_element = -1);

}  // namespace pn
