// Gaps of contacts, and lines on which their normal forces act, at many states. Loads and modes are not evaluated.
#pragma once

#include <nanobind/nanobind.h>

namespace pn {

void bind_contact_geometry(nanobind::module_& m);

}  // namespace pn
