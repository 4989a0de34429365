// Outcome of a run: its records as arrays, its events and its counters.
#pragma once

#include "python/arrays.hpp"
#include "run/output/recorder.hpp"

namespace pn {

// Results of a finished run.
struct Outcome {
    Counters counters;
    Recording recording;
};

// Register the outcome of a run and its events.
void bind_outcome(nb::module_& m);

}  // namespace pn
