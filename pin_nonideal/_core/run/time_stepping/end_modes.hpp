// Modes of friction elements at the end of a time step, by one rule for scenes with and without contacts: an element
// sticks if its force holds it or if its slip is zero up to rounding.
#pragma once

#include "contact/impact.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

struct EndModeParameters {
    double max_stopped_slip = 1e-6;  // slip of an element that stops, relative to 1 + the largest velocity
};

class EndModes {
public:
    using Parameters = EndModeParameters;
    static constexpr Parameters parameters{};

    // v: velocity of the scene.
    explicit EndModes(const VecX& v) : fastest_(1.0 + v.cwiseAbs().maxCoeff()), still_(rest_rate(v)) {}

    // Check if a slip is zero up to rounding and its `error`.
    bool is_rest(double slip, double error = 0.0) const { return slip <= still_ + error; }
    // Check if a slip is so slow that an element stops if its force can hold it.
    bool is_stopped(double slip) const { return slip <= parameters.max_stopped_slip * fastest_; }
    // Check if the slip speed exceeds rest by less than the force exceeds its limit, each relative to its scale. An element
    // whose solution satisfies neither condition then sticks.
    bool is_nearer_to_rest(double slip, double force, double limit) const {
        return slip * limit <= (limit - force) * fastest_;
    }

    // Return the mode of an element, and set the velocity of a dof that it holds to exactly zero.
    static Mode settle(bool sticks, bool slips_forward, const Block& block, VecX& v) {
        if (sticks && block.dof >= 0) v.segment(block.dof, block.total).setZero();
        return sticks ? sticking : slips_forward ? slip_plus : slip_minus;
    }

private:
    double fastest_, still_;
};

}  // namespace pn
