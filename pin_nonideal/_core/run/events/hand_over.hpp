// Hand-over of a closed contact from one feature of a shape to the next, as a corner that slides from a face onto an
// edge. The gap and its rate stay continuous there, but its second derivative jumps. A step across this instant would
// hold the contact on the wrong feature. The step therefore ends at the instant, and the modes are selected again.
#pragma once

#include <optional>

#include "run/output/checkpoint.hpp"

namespace pn {

class HandOver {
public:
    HandOver(System& system, Progress& progress);

    // Return the time from the current state to the first hand-over of a closed contact within `size`, on a motion with
    // the current acceleration. The state after this time is the first one with the next feature.
    std::optional<double> first(double size);
    // Check if the motion with the current acceleration is exact up to this time.
    bool is_reached(double time) const;
    // Return the length of a step that ends just before a hand-over.
    static double step_before(double time);
    // Move the current state by this time, with the current acceleration.
    void pass(double time);

private:
    void move(double time);
    double drift(int gap);
    double drift_after(double time, int gap);
    bool find(int gap, double& size);

    System& system_;
    Progress& now_;
    const Program& p;
    Workspace& w;
    VecX move_, y_;
};

}  // namespace pn
