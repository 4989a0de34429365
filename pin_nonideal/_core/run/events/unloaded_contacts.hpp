// Closed contacts without a load. Rounding alone would decide if such contacts hold their bodies, so the run opens
// them.
#pragma once

#include <vector>

#include "run/integrators/system.hpp"

namespace pn {

struct UnloadedContactsParameters {
    // Loads above this multiple of their rounding are compressive beyond doubt. Contacts near each other amplify the
    // rounding error of their loads, by the ratio of the size of the body to their distance.
    double surely_pressing = 1e6;
    // Maximum difference of equal accelerations, relative to all accelerations. Bodies that pass an edge between
    // two others have 1e-11 from rounding.
    double same_acceleration = 1e-9;
};

inline constexpr UnloadedContactsParameters unloaded_contacts_parameters{};

// Check if the two bodies of a gap have the same motion without their contacts, at the state last read.
bool is_unloaded(System& system, double t, int gap);

// Open the contacts of all pairs of bodies that have the same motion without their contacts. Return these contacts.
std::vector<int> open_unloaded_contacts(System& system, double t);

}  // namespace pn
