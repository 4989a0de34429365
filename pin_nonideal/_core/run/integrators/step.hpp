// Integration step on a flat state y, with its rates.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct Step {
    double t0 = 0.0, h = 0.0;
    VecX y0, y1;
    int stages = 1;
    int states;  // number of entries of y that determine the rates, the watch entries follow
    int active;  // number of entries of y that change in this step, without watch entries of inactive elements
    // Rates of the stages, the first at y0. The rate at y1 follows, which the caller computes. The further stages of
    // the interpolant follow last.
    std::vector<VecX> rates;

    Step(int stage_count, int rate_count, int state_count, int size)
        : y0(VecX::Zero(size)), y1(VecX::Zero(size)), stages(stage_count), states(state_count), active(size),
          rates(rate_count, VecX::Zero(size)) {}
    VecX& start_rate() { return rates[0]; }
    VecX& end_rate() { return rates[stages]; }
};

}  // namespace pn
