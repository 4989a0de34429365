// The finished program as Python sees it.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_program(nb::module_& m);

}  // namespace pn
