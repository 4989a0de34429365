// Groups of contacts that differ in the places of their features, such as the corners or the edges of two boxes. One call
// of the builder adds a whole group.
#pragma once

#include "python/builder.hpp"

namespace pn {

// Bind, each with its friction: Builder.repeat_contact, which adds contacts like the last one with other frames 1, and
// Builder.add_capsule_pairs, which adds the contacts of each of some capsules with each of other capsules.
void bind_contact_groups(nb::class_<Builder>& builder);

}  // namespace pn
