// Bindings of runs that Python advances period by period.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_stepped(nb::module_& m);

}  // namespace pn
