// Active set of contacts: closed contacts have compressive loads, and open contacts separate. All resting contacts are
// closed if a motion exists in which all of them have compressive loads. Among several valid active sets the largest is
// selected.
#pragma once

#include <functional>

#include "contact/onset.hpp"

namespace pn {

struct ActiveSetParameters {
    // Enumerate all active sets up to this many contacts if pivoting fails.
    int max_enumerated_contacts = 12;
    // Limit of the enumeration if slip directions must be consistent too. Without this condition a motion to integrate
    // is known already.
    int max_aligned_contacts = 8;
    // Minimum number of contacts that can share a load in several ways.
    int may_share = 2;
    // Minimum slip acceleration that defines a direction, relative to the scale of accelerations, and allowed deviation
    // of the direction (1 - cosine).
    double min_direction_acceleration = 1e-4, max_direction_deviation = 1e-6;
    double same_motion = 1e-7;  // difference of accelerations below which two motions are one, relative to the largest
};

inline constexpr ActiveSetParameters active_set_parameters{};

// Check if all slip that begins from rest opposes its friction. If one contact would need tension, other contacts may
// hide it with friction that violates their own law.
bool slip_opposes_friction(const Program& p, Workspace& w, const VecX& v);

// Select the closed contacts among those at rest at (t, q, v). `find_modes` computes the stick-slip modes for closed
// contacts, or takes them from the joint motion of all contacts if given. On return the workspace holds the motion at
// v. If no consistent solution exists, some slip directions are not consistent yet, and integration corrects them.
//
// Contacts that share a load are decided together. Other contacts are decided one by one, which tests uniqueness, and
// together if this does not converge.
void select_active_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                            const OnsetQuery& query, const std::function<void(const OnsetMotion*)>& find_modes);

}  // namespace pn
