// Many runs as arrays: samples of states alone, without an object for each run.
#pragma once

#include "python/arrays.hpp"

namespace pn {

void bind_batch(nb::module_& m);

}  // namespace pn
