// Bindings of runs whose steps are taken by an integrator in Python.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_followed(nb::module_& m);

}  // namespace pn
