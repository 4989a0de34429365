// Closed contacts without a load. Rounding alone would decide if such contacts hold their bodies, so the run opens
// them.
#pragma once

#include <vector>

#include "run/integrators/system.hpp"

namespace pn {

// Check if the two bodies of a gap move the same without their contacts, at the state last read.
bool is_unloaded(System& system, double t, int gap);

// Open the contacts of all pairs of bodies that move the same without them. Return these contacts.
std::vector<int> open_unloaded_contacts(System& system, double t);

}  // namespace pn
