// Runs from a start, or from a checkpoint, to their end.
#pragma once

#include <exception>
#include <string>

#include "run/options.hpp"

namespace pn {

// Call `steps`, and store the failure or exception that ends them in `out`.
template <class Steps>
void record_end(Recording& out, const Steps& steps) {
    try {
        steps();
    } catch (const Failure& failure) {
        out.failure = failure;
    } catch (const EndOfRun& end) {
        out.failure = end.failure;
    } catch (...) {
        out.error = std::current_exception();
    }
}

// Simulate from (q0, v0) into `out`. A failure ends the run, is stored in `out`, and keeps the samples.
void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out);
// Resume a run in a new workspace from the bytes that `save` received, with the same options. Throw
// std::invalid_argument if the bytes do not fit the scene.
void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out);

}  // namespace pn
