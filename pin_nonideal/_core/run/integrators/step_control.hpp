// Control of the error: which steps are accepted, and how long the next one is.
#pragma once

#include <optional>

#include "dynamics/failure.hpp"
#include "run/integrators/method.hpp"

namespace pn {

// Error of a step that could not be evaluated: the next one is as short as the control makes it.
constexpr double failed_error = 1e4;

class StepControl {
public:
    StepControl(const Method& method, double rtol) : method_(method), rtol_(rtol) {}

    // Norm of the error at which the next step is as long as the last.
    static double aim(const Method& method);

    // Whether rounding near a singular position would spoil the stages of a step, which one of another length keeps clear
    // of: least pivot of the rows' factor at the stages, and its pivots at both ends.
    bool needs_detour(double least_pivot, double start_pivot, double end_pivot) const;
    // Whether a step of this size is accepted, with this norm of its error (1 at the tolerance; none: a detour), and the
    // size of the next one, or of its next trial, in h. `last`: it was cut at a stop.
    bool accepts(std::optional<double> error, double size, bool last, double& h);

private:
    const Method& method_;
    double rtol_;
    bool last_rejected_ = false;
    int detours_ = 0;  // of this step, around a singular position
};

}  // namespace pn
