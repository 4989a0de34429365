// Runs that Python takes period by period.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_stepped(nb::module_& m);

}  // namespace pn
