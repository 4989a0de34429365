// Bindings of runs, one or many at once, and of their results.
#pragma once

#include "python/runner.hpp"

namespace pn {

void bind_runs(nb::module_& m, nb::class_<Runner>& runner);

}  // namespace pn
