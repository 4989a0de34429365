// A failure of the core as the exception that Python sees: `CoreFailure` with kind, time, elements and value.
#pragma once

#include <nanobind/nanobind.h>

#include "dynamics/failure.hpp"

namespace pn {

namespace nb = nanobind;

// What Python sees of a failure: an exception with its kind, time, elements and value.
nb::object failure_object(const Failure& failure);

void bind_failures(nb::module_& m);

}  // namespace pn
