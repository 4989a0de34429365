// Bindings of the finished program.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_program(nb::module_& m);

}  // namespace pn
