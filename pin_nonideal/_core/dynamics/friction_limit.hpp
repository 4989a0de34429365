// Friction elements in the current motion: slip, load, friction limit and force.
#pragma once

#include <utility>

#include "dynamics/workspace.hpp"
#include "forces/bearing_load.hpp"

namespace pn {

// Slip velocity along an element's directions, from the rows last evaluated.
Vec3 slip_velocity(const Evaluation& now, const Friction& f);
// Slip accelerations of an element in the current motion, along its directions.
Vec3 slip_acceleration(const Program& p, Workspace& w, const Friction& f);
// Slip speed along the direction of the element's mode, and its rate in the current motion.
double slip_along_mode(const Program& p, const Workspace& w, int element);
double slip_rate_along_mode(const Program& p, Workspace& w, int element);
// Slip speed along the mode and its rate, or the total slip speed and its rate if slip has turned by more than 45 degrees.
std::pair<double, double> slip_toward_rest(const Program& p, Workspace& w, int element);
// Friction limit under a load at the current slip speed. A sticking element has slip speed zero.
double limit_under(const Program& p, const Workspace& w, int element, double load);
// Axis of an element that bears the load of a tree joint.
Vec3 bearing_axis(const Terms& terms, const Friction& f);
// Load vectors of an element in the current motion, linear in the reactions. All are zero for a user's limit.
LoadVectors load_vectors(const Program& p, Workspace& w, const Friction& f);
// Friction limits of an element at rest due to its load, without the static ratio, for the motion in the workspace.
SlipLimits load_limits(const Program& p, Workspace& w, const Friction& f, double t, const VecX& q, const VecX& v);
// Update load and kinetic limit of an element for the motion in the workspace.
void update_limit(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// Limits of the force of an element that sticks in the current motion.
SlipLimits static_limits(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);

// Clear the slip directions of the step's start. States inside a step contain no reversal and set new directions.
void reset_slip_directions(Workspace& w);
// Friction force of an element in the last evaluation: the multiplier if it sticks, else the force of its law.
Vec3 friction_force(const Program& p, Workspace& w, int element);
// Force of a sticking element relative to the middle of its limits, and the maximum of its magnitude.
struct HoldingForce {
    Vec3 force;
    double limit = 0.0;
    bool is_within(double slack) const { return force.norm() <= limit * (1.0 + slack); }
};
HoldingForce holding_force(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// Check if forces of the motion in the workspace hold the sticking elements of a list and press the closed contacts. The
// shares of loads have minimum norm. Other shares may hold the elements if these do not.
bool shares_hold(const Program& p, Workspace& w, const std::vector<int>& list, double t, const VecX& q, const VecX& v);
// Nearest bound of the friction force of a sticking element, limit of a slipping element, zero without load.
double current_limit(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// Unit direction of the friction force of a slipping element.
Vec3 force_direction(const Program& p, Workspace& w, int element);
// Add the current force of a slipping element to a generalized force. The motion does not change.
void add_current_slip_force(const Program& p, const Workspace& w, int element, VecX& C);
// Compute the force of a slipping element for the limit in the workspace, and add the force to a generalized force.
// add_slip_forces adds the forces of all slipping elements, with (`load_dependent`) or without a load from reactions.
void add_slip_force(const Program& p, Workspace& w, int element, VecX& C);
void add_slip_forces(const Program& p, Workspace& w, bool load_dependent, VecX& C);

}  // namespace pn
