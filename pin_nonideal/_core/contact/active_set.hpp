// Active set of contacts: closed contacts have compressive loads, and open contacts separate. All resting contacts are
// closed if a motion exists in which all of them have compressive loads. Among several valid active sets the largest is
// selected.
#pragma once

#include <functional>

#include "contact/onset.hpp"

namespace pn {

struct ActiveSetParameters {
    // Time [s] within which a closing gap touches.
    double touching_time = 1e-12;
    // At the start of a run, gaps up to this fraction of the scene's size touch.
    double starting_width = 1e-10;
    // Enumerate all active sets up to this many contacts if pivoting fails.
    int max_enumerated_contacts = 12;
    // Limit of the enumeration if slip directions must be consistent too. Without this condition a motion to integrate
    // is known already.
    int max_aligned_contacts = 8;
    // No body closes a wider gap [m or rad] within `touching_time`: its speed would exceed the speed of light.
    double sure_gap = 1e-3;
    // Minimum number of contacts that can share a load in several ways.
    int may_share = 2;
    // Minimum slip acceleration that defines a direction, relative to the scale of accelerations, and allowed deviation
    // of the direction (1 - cosine).
    double min_direction_acceleration = 1e-4, max_direction_deviation = 1e-6;
    double same_motion = 1e-7;  // difference of accelerations below which two motions are one, relative to the largest
};

inline constexpr ActiveSetParameters active_set_parameters{};

// Contact state: touching contacts, resting contacts, and impacts.
struct TouchingContacts {
    std::vector<char> touch, rest;
    bool strikes = false;
    bool lands = false;  // some impact is at an open contact
};
// Find touching contacts from the widths and rates of the gaps at (t, q, v): closed gaps and narrow gaps. Of several
// coincident gaps, only the gap that opens last counts, else a closed gap.
TouchingContacts touching_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts);

// Caches the touching contacts of the last state.
class TouchingCache {
public:
    const TouchingContacts& at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts);

private:
    bool is_set_ = false, starts_ = false;
    double t_ = 0.0;
    VecX q_, v_;
    std::vector<char> closed_;
    TouchingContacts found_;
};

// Check if all slip that begins from rest opposes its friction. If one contact would need tension, other contacts may
// hide it with friction that violates their own law.
bool slip_opposes_friction(const Program& p, Workspace& w, const VecX& v);

// Select the closed contacts among those at rest at (t, q, v). `find_modes` computes the stick-slip modes for closed
// contacts, or takes them from the joint motion of all contacts if given. On return the workspace holds the motion at
// v. If no consistent solution exists, some slip directions are not consistent yet, and integration corrects them.
void select_active_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                            const OnsetQuery& query, const std::function<void(const OnsetMotion*)>& find_modes);

}  // namespace pn
