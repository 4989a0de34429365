// Runs whose steps an integrator of Python takes.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_followed(nb::module_& m);

}  // namespace pn
