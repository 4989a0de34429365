// Nonideal laws: what C(q, v, t, reactions) is made of (Eq. 9, w^T F^c = w^T C).
//
// Frictional elements own directions (a block of rows whose rate is the slip velocity) and a limit. In a mode of slip
// their force is -limit along the slip; in the mode of sticking their rows join the constraints and the limit only
// bounds the multiplier. Loads come from the reactions of the total motion, so limits and reactions are solved
// together (solve_reactions).
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "constraints/constraints.hpp"

namespace pn {

// Mode of a frictional element: it slips one way (+1, -1; +1 for several directions), sticks, or, while the modes are
// being sought, carries no friction at all.
constexpr signed char sticking = 0, unloaded = 2;
inline bool slips(signed char mode) { return mode == 1 || mode == -1; }

enum class Reaction { none, ideal, total };

struct Program;
struct Workspace;

struct Friction {
    enum class Load { none, revolute, prismatic, spherical, contact, user } load = Load::none;
    std::string name;
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
    std::function<double(double t, const VecX& q, const VecX& v, Workspace& w)> user_limit;
};

struct Viscous {  // C = -coefficient v on dofs, or on the slip velocity of a friction's directions
    int law = 0, dof = -1, count = 0, block = -1;
    double coefficient = 0.0;
};

struct Drag {  // force -coefficient |u|^(exponent - 1) u at the origin of a frame
    int law = 0;
    Frame frame;
    double coefficient = 0.0, exponent = 1.0;
    std::vector<int> dofs;  // that move the frame
};

struct Sigmoid {  // identified robot friction, phi1/(1+exp(-phi2 (v+phi3))) - phi1/(1+exp(-phi2 phi3))
    int law = 0, dof = 0;
    double phi1 = 0.0, phi2 = 0.0, phi3 = 0.0;
};

struct Bristle {  // LuGre: F = sigma0 z + sigma1 dz + sigma2 v, dz = v - sigma0 |v| z / g(v)
    int law = 0, dof = 0, state = 0;
    double sigma0 = 0.0, sigma1 = 0.0, sigma2 = 0.0, coulomb = 0.0, stiction = 0.0, stribeck_velocity = 1.0;
};

struct UserLaw {
    int law = 0, state = 0, states = 0;
    Reaction reaction = Reaction::none;
    // C (and dz when it has states) for provisional reactions held in the workspace.
    std::function<void(double t, const VecX& q, const VecX& v, Workspace& w, VecX& C, const double* z, double* dz)>
        function;
};

// Wrench that crosses a joint onto its child body, [force; moment about the joint's origin], world axes, for the
// reactions held in the workspace; and the one of an anchor on the body of frame 1, about the anchor's point.
Force joint_wrench(const Program& p, const Workspace& w, int joint);
Force anchor_wrench(const Program& p, const Workspace& w, int block);

// Slip velocity along an element's directions, of the rows evaluated last.
Vec3 slip_velocity(const Workspace& w, const Friction& f);

// Friction limit of an element for the load held in the workspace, and its factor at a slip speed.
double load_limit(const Program& p, Workspace& w, const Friction& f, double t, const VecX& q, const VecX& v);
double speed_factor(const Friction& f, double speed);

// C of every law that does not read reactions, and the constant part of slipping friction.
void smooth_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// C of each law at the evaluation in the workspace, into w.now.law_force.
void law_forces(const Program& p, Workspace& w, const VecX& v);
// Adds the friction forces of slipping elements to a generalized force, for the limits held in the workspace.
void add_slip_forces(const Program& p, Workspace& w, VecX& C, bool load_dependent);
// Makes reactions of the acceleration and multipliers in the workspace, and of the forces of the laws on bodies unless
// the motion is the ideal one.
void gather_reactions(const Program& p, Workspace& w, bool nonideal = true);
// C of load-dependent laws together with the reactions of the motion that they cause.
void solve_reactions(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
