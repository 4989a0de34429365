// Dry friction: elements that slip or stick along the directions of a block (rows whose rate is the slip velocity).
//
// In a mode of slip the force of an element is -limit along the slip; in the mode of sticking its rows join the
// constraints and the static limit only bounds the multiplier. The limit comes from the load at hand and the slip speed:
// limit = load x speed factor.
#pragma once

#include <string>
#include <utility>

#include "forces/laws.hpp"
#include "forces/mode.hpp"

namespace pn {

// Limits of the friction against slip forward and backward, along the direction of an element and against it:
// -forward <= force <= backward. Elements of several directions have one limit for all.
struct SlipLimits {
    double forward = 0.0, backward = 0.0;

    SlipLimits() = default;
    SlipLimits(double limit) : forward(limit), backward(limit) {}
    SlipLimits(double ahead, double back) : forward(ahead), backward(back) {}
    double against(Mode slip) const { return slip == slip_minus ? backward : forward; }
    // The bound that a force is nearest to.
    double bounding(double force) const { return force > middle() ? backward : forward; }
    // |force - middle| <= reach.
    double middle() const { return 0.5 * (backward - forward); }
    double reach() const { return 0.5 * (backward + forward); }
    SlipLimits operator*(double factor) const { return {factor * forward, factor * backward}; }
};

struct Friction {
    enum class Load { none, revolute, prismatic, spherical, planar, multiplier, user } load = Load::none;
    std::string name;
    int law = 0;    // index into Program::law_names
    int block = 0;  // its directions
    int dim = 1;
    double constant = 0.0;  // coulomb + preload
    double mu = 0.0, radius = 0.0, axial_radius = 0.0, inverse_span = 0.0;
    double static_ratio = 1.0, stribeck_velocity = 0.0;  // 0: kinetic friction at any slip velocity
    Reaction reaction = Reaction::none;
    int joint = -1;   // tree joint that carries the load
    int anchor = -1;  // or the block (of an anchor, a contact or a coupling) that does
    int gap = -1;        // where that is a contact that may open: its number, as Program::finish finds it
    int anchor_row = 0;  // where one multiplier is the load: which of the anchor's
    int row = -1;        // and its place among the rows of all descriptions, as Program::finish finds it
    Vec3 axis = Vec3::UnitZ();  // in the joint's frame, or in frame 1 of the anchor
    int axis_dof = -1;          // dof whose axis it is, where it is fixed in no frame
    std::function<SlipLimits(const Program& p, double t, const VecX& q, const VecX& v, Workspace& w)> user_limit;

    bool varies_with_speed() const { return static_ratio != 1.0 && stribeck_velocity != 0.0; }
    // Limit over load at a slip speed.
    template <class Real>
    Real speed_factor(const Real& speed) const {
        using std::exp;
        if (!varies_with_speed()) return 1.0;
        const Real x = speed / stribeck_velocity;
        return 1.0 + (static_ratio - 1.0) * exp(-x * x);
    }
    // The limit under a load: of an element that slips at this speed, and of one that sticks.
    double kinetic_limit(double load, double speed) const { return load * speed_factor(speed); }
    double holding_limit(double load) const { return load * static_ratio; }
};

}  // namespace pn
