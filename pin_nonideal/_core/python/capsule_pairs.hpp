// Contacts of each of some capsules with each of other capsules, such as the edges of two boxes. One call of the builder
// adds all of them.
#pragma once

#include "python/builder.hpp"

namespace pn {

// Bind Builder.add_capsule_pairs, which returns the first block, and Builder.add_capsule_pair_friction.
void bind_capsule_pairs(nb::class_<Builder>& builder);

}  // namespace pn
