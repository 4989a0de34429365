// Dry friction: elements that slip or stick along the directions of a block (rows whose rate is the slip velocity).
//
// In a mode of slip the force of an element is -limit along the slip; in the mode of sticking its rows join the
// constraints and the static limit only bounds the multiplier. The limit comes from the load at hand and the slip speed:
// limit = load x speed factor.
#pragma once

#include <utility>

#include "friction/laws.hpp"
#include "friction/mode.hpp"

namespace pn {

struct Friction {
    enum class Load { none, revolute, prismatic, spherical, contact, user } load = Load::none;
    int law = 0;    // index into Program::law_names
    int block = 0;  // its directions
    int dim = 1;
    double constant = 0.0;  // coulomb + preload
    double mu = 0.0, radius = 0.0, axial_radius = 0.0, inverse_span = 0.0;
    double static_ratio = 1.0, stribeck_velocity = 0.0;  // 0: kinetic friction at any slip velocity
    Reaction reaction = Reaction::none;
    int joint = -1;   // tree joint that carries the load
    int anchor = -1;  // or the block (hinge anchor, contact) that does
    Vec3 axis = Vec3::UnitZ();  // in the joint's frame, or in frame 1 of the anchor
    std::function<double(const Program& p, double t, const VecX& q, const VecX& v, Workspace& w)> user_limit;

    // Limit over load at a slip speed.
    template <class Real>
    Real speed_factor(const Real& speed) const {
        using std::exp;
        if (static_ratio == 1.0 || stribeck_velocity == 0.0) return 1.0;
        const Real x = speed / stribeck_velocity;
        return 1.0 + (static_ratio - 1.0) * exp(-x * x);
    }
    // The limit under a load: of an element that slips at this speed, and of one that sticks.
    double kinetic_limit(double load, double speed) const { return load * speed_factor(speed); }
    double holding_limit(double load) const { return load * static_ratio; }
};

// Slip velocity along an element's directions, of the rows evaluated last.
Vec3 slip_velocity(const Evaluation& now, const Friction& f);
// Slip speed the way that the element's mode says, and its rate in the motion at hand.
double slip_along_mode(const Program& p, const Workspace& w, int element);
double slip_rate_along_mode(const Program& p, Workspace& w, int element);
// The same where slip of several directions goes through rest or on: where it turns sideways, its size and the rate of it.
std::pair<double, double> slip_toward_rest(const Program& p, Workspace& w, int element);
// The limit under a load at the present slip speed, at rest where an element sticks.
double limit_under(const Program& p, const Workspace& w, int element, double load);
// The load of an element, as the limit that it gives at rest without the static ratio, for the motion in the workspace.
double load_limit(const Program& p, Workspace& w, const Friction& f, double t, const VecX& q, const VecX& v);
// Load and kinetic limit of an element for that motion.
void update_limit(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);
// Largest force with which an element can stick now.
double static_limit(const Program& p, Workspace& w, int element, double t, const VecX& q, const VecX& v);

// Friction force of an element in the evaluation at hand: the multiplier of what sticks, the law's force of what slips.
Vec3 friction_force(const Program& p, Workspace& w, int element);
// Adds the force of a slipping element, for the limit in the workspace, to a generalized force; or those of all whose
// load comes from these reactions (`loaded`: from any).
void add_slip_force(const Program& p, Workspace& w, int element, VecX& C);
void add_slip_forces(const Program& p, Workspace& w, bool loaded, VecX& C);
// C += A^T f for a force along the rows of a block.
void add_along(const Block& block, const Evaluation& now, const Vec3& f, VecX& C);
// Adds a unit wrench times its size to the forces on the two bodies of a block, about their reference points.
void add_wrench(const Block& block, const Terms& terms, const Wrench& unit, double size, std::vector<Force>& body);

}  // namespace pn
