// Failures of the core as Python exceptions: `CoreFailure` with kind, time, elements and value.
#pragma once

#include <nanobind/nanobind.h>

#include "dynamics/failure.hpp"

namespace pn {

namespace nb = nanobind;

// Return the exception of a failure, with its kind, time, elements, value and solutions.
nb::object failure_object(const Failure& failure);

void bind_failures(nb::module_& m);

}  // namespace pn
