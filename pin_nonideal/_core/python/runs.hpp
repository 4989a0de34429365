// Runs as Python asks for them, one or many at once, and what they leave behind.
#pragma once

#include "python/runner.hpp"

namespace pn {

void bind_runs(nb::module_& m, nb::class_<Runner>& runner);

}  // namespace pn
