// One step of integration on a flat state y, and the rates found on its way.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct Step {
    double t0 = 0.0, h = 0.0;
    VecX y0, y1;
    int stages = 1;
    int states;  // numbers of y from which the rates follow; after them what elements and gaps are watched by
    int active;  // numbers of y that change in this step: none of what is watched where all is open
    // Of the stages, the first at y0; then the one at y1, which is the caller's to find; then those of further stages
    // of the interpolant.
    std::vector<VecX> rates;

    Step(int stage_count, int rate_count, int state_count, int size)
        : y0(VecX::Zero(size)), y1(VecX::Zero(size)), stages(stage_count), states(state_count), active(size),
          rates(rate_count, VecX::Zero(size)) {}
    VecX& start_rate() { return rates[0]; }
    VecX& end_rate() { return rates[stages]; }
};

}  // namespace pn
