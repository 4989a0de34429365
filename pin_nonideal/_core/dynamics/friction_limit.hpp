// Elements of dry friction in the motion at hand: how they slip, what loads them, the force that they exert.
#pragma once

#include <array>
#include <utility>

#include "dynamics/workspace.hpp"

namespace pn {

// Slip slower than this part of the scene's speed has no direction of its own but rounding.
constexpr double directed_speed = 1e-9;

// Slip velocity along an element's directions, of the rows evaluated last.
Vec3 slip_velocity(const Evaluation& now, const Friction& f);
// Slip speed the way that the element's mode says, and its rate in the motion at hand.
double slip_along_mode(const Program& p, const Workspace& w, int element);
double slip_rate_along_mode(const Program& p, Workspace& w, int element);
// The same where slip of several directions goes through rest or on: where it turns sideways, its size and the rate of it.
std::pair<double, double> slip_toward_rest(const Program& p, Workspace& w, int element);
// The limit under a load at the present slip speed, at rest where an element sticks.
double limit_under(const Program& p, const Workspace& w, int element, double load);
// What loads an element in the motion at hand, as vectors linear in the reactions whose lengths add up to what the limit
// has beyond its constant part. Those that a bearing has not are zero; a user's limit has none.
using LoadVectors = std::array<Vec3, 3>;
LoadVectors load_vectors(const Program& p, Workspace& w, const Friction& f);
// The load of an element, as the limits that it gives at rest without the static ratio, for the motion in the workspace.
SlipLimits load_limits(const Program& p, Workspace& w, const Friction& f, double t, const VecX& q, const VecX& v);
// Load and kinetic limit of an element for that motion.
void update_limit(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// Limits of the force with which an element can stick now.
SlipLimits static_limits(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);

// Lets states between the ends of a step tell the directions of their slip themselves, in which no reversal lies.
void forget_slip_directions(Workspace& w);
// Friction force of an element in the evaluation at hand: the multiplier of what sticks, the law's force of what slips.
Vec3 friction_force(const Program& p, Workspace& w, int element);
// The force of an element that sticks, from the middle of its limits, and how far it may lie from there.
struct HoldingForce {
    Vec3 force;
    double limit = 0.0;
    bool is_within(double slack) const { return force.norm() <= limit * (1.0 + slack); }
};
HoldingForce holding_force(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// The bound of its friction force that a sticking element is nearest to, the limit of one that slips, none of others.
double limit_at_hand(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// Adds the force of a slipping element, for the limit in the workspace, to a generalized force; or those of all whose
// load comes from these reactions (`loaded`: from any).
void add_slip_force(const Program& p, Workspace& w, int element, VecX& C);
void add_slip_forces(const Program& p, Workspace& w, bool loaded, VecX& C);

}  // namespace pn
