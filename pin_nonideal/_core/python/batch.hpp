// Many runs as arrays of state samples, without an object per run.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_batch(nb::module_& m);

}  // namespace pn
