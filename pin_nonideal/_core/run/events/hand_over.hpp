// Hand-over of a closed contact from one feature of a shape to the next, as a corner that slides from a face onto an
// edge. The gap and its rate stay continuous at a hand-over, but the second derivative jumps. A step across this
// instant would hold the contact on the wrong feature. The step therefore ends at the instant, and the modes are
// selected again.
#pragma once

#include <optional>

#include "run/output/checkpoint.hpp"

namespace pn {

struct HandOverParameters {
    // A jump keeps at least this fraction of a change in one half of each bisected interval. A smooth function keeps less.
    double kept_bias_change = 0.3;
    // Longest time [s, or relative to the time above 1 s] in which the change of the acceleration is negligible.
    double steady_time = 1e-12;
    // Time [s, or relative to the time above 1 s] in which features pass each other by more than rounding.
    double passing_time = 1e-13;
    // Fraction of the time to a hand-over that is left to the next step, since the acceleration changes meanwhile.
    double left_before = 1e-3;
    // Width [s, or relative to the time above 1 s] of the interval that contains a hand-over. The width is below the spacing
    // of times, so the state after the interval lies at the feature up to rounding.
    double width = 1e-18;
};

class HandOver {
public:
    using Parameters = HandOverParameters;
    static constexpr Parameters parameters{};

    HandOver(System& system, Progress& progress);

    struct Found {
        double time;  // from the current state
        int gap;
    };
    // Return the first hand-over of a closed contact within the time `size` [s] at constant acceleration. The state after
    // its time is the first one with the next feature.
    std::optional<Found> first(double size);
    // Check if the bodies of a gap have no load in the current state, so that their contacts need no hand-over.
    bool is_unloaded(int gap);
    // Check if the motion with the current acceleration is exact up to this time.
    bool is_reached(double time) const;
    // Return the length of a step that ends just before a hand-over.
    static double step_before(double time);
    // Move the current state just past a hand-over after this time, with the current acceleration.
    void pass(double time);

private:
    void move(double time);
    double bias(int gap);
    double bias_after(double time, int gap);
    bool find(int gap, double& size);

    System& system_;
    Progress& progress_;
    const Program& p;
    Workspace& w;
    VecX move_, y_;
};

}  // namespace pn
