// Solver of contacts and friction on arrays.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_cones(nb::module_& m);

}  // namespace pn
