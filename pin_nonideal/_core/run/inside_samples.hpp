// Samples inside the steps of a run that has ended, from its dense output.
#pragma once

#include <vector>

#include "run/recorder.hpp"

namespace pn {

// States inside steps, each with what its step held.
struct InsideStates {
    std::vector<double> t, moved;
    std::vector<VecX> y, torque, directions;
    std::vector<std::vector<Mode>> modes;
};
// Puts them on the constraints and samples them.
void sample_inside(const Program& p, Workspace& w, const InsideStates& inside, const RecordOptions& options,
                   Recording& out);

}  // namespace pn
