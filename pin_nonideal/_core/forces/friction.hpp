// Dry friction: elements that slip or stick along the directions of a block (rows with the slip velocity as rate).
//
// A slipping element exerts the force -limit along the slip. The rows of a sticking element join the constraints, and
// the static limit only bounds the multiplier. The limit is the current load times the speed factor.
#pragma once

#include <string>
#include <utility>

#include "forces/laws.hpp"
#include "forces/mode.hpp"

namespace pn {

// Limits of the friction force against forward and backward slip, along the direction of an element:
// -forward <= force <= backward. Elements of several directions have one limit for all.
struct SlipLimits {
    double forward = 0.0, backward = 0.0;

    SlipLimits() = default;
    SlipLimits(double limit) : forward(limit), backward(limit) {}
    SlipLimits(double ahead, double back) : forward(ahead), backward(back) {}
    double against(Mode slip) const { return slip == slip_minus ? backward : forward; }
    // Return the bound that is nearest to the force.
    double bounding(double force) const { return force > middle() ? backward : forward; }
    // Bounds in the form |force - middle| <= reach.
    double middle() const { return 0.5 * (backward - forward); }
    double reach() const { return 0.5 * (backward + forward); }
    SlipLimits operator*(double factor) const { return {factor * forward, factor * backward}; }
};

struct Friction {
    enum class Load { none, revolute, prismatic, spherical, planar, multiplier, user } load = Load::none;
    std::string name;
    int law = 0;    // index into Program::law_names
    int block = 0;  // block of its slip directions
    int dim = 1;
    double constant = 0.0;  // coulomb + preload
    double mu = 0.0, radius = 0.0, axial_radius = 0.0, inverse_span = 0.0;
    double static_ratio = 1.0, stribeck_velocity = 0.0;  // 0: kinetic friction at any slip velocity
    Reaction reaction = Reaction::none;
    int joint = -1;   // tree joint that carries the load
    int anchor = -1;  // or block (anchor, contact or coupling) that carries the load
    int gap = -1;        // number of that block if it is a unilateral contact, set by Program::finish
    int anchor_row = 0;  // row of the anchor, if one multiplier is the load
    int row = -1;        // index of that row among the rows of all descriptions, set by Program::finish
    Vec3 axis = Vec3::UnitZ();  // in the joint's frame, or in frame 1 of the anchor
    int axis_dof = -1;          // dof that has this axis, if the axis is fixed in no frame
    std::function<SlipLimits(const Program& p, double t, const VecX& q, const VecX& v, Workspace& w)> user_limit;

    bool varies_with_speed() const { return static_ratio != 1.0 && stribeck_velocity != 0.0; }
    // Return the ratio of limit to load at a slip speed.
    template <class Real>
    Real speed_factor(const Real& speed) const {
        using std::exp;
        if (!varies_with_speed()) return 1.0;
        const Real x = speed / stribeck_velocity;
        return 1.0 + (static_ratio - 1.0) * exp(-x * x);
    }
    // Return the limit under a load, of an element that slips at this speed and of a sticking element.
    double kinetic_limit(double load, double speed) const { return load * speed_factor(speed); }
    double holding_limit(double load) const { return load * static_ratio; }
};

}  // namespace pn
