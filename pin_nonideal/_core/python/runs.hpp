// Runs as Python asks for them, one or many at once, and what they leave behind.
#pragma once

#include "python/arrays.hpp"
#include "run/simulation.hpp"

namespace pn {

struct Runner;

// A run that has ended.
struct Outcome {
    Counters counters;
    Recording recording;
};

void bind_runs(nb::module_& m, nb::class_<Runner>& runner);

}  // namespace pn
