// Runs from a start, or from a checkpoint, to their end.
#pragma once

#include <string>

#include "run/options.hpp"

namespace pn {

// Simulate from (q0, v0) into `out`. A failure ends the run, is stored in `out`, and keeps the samples.
void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out);
// Resume a run in a new workspace from the bytes that `save` received, with the same options. Throw
// std::invalid_argument if the bytes do not fit the scene.
void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out);

}  // namespace pn
