// Unilateral contacts: gaps, gap rates, and loads of closed contacts.
#pragma once

#include <functional>
#include <vector>

#include "dynamics/workspace.hpp"

namespace pn {

struct ContactQueryParameters {
    // Rounding error of a sum, relative to the sum of the magnitudes of its terms.
    double sum_rounding = 1e-12;
    // Tolerance of coincident lines and points: relative distance from the origin, or sine of an angle.
    double coincidence_tolerance = 1e-12;
};

inline constexpr ContactQueryParameters contact_query_parameters{};

// Check if a contact has no mobility along its normal. Such a contact never closes.
inline bool is_bare(const Program& p, int gap) { return p.blocks[p.gaps[gap].block].kept.empty(); }

// Width of a gap [m or rad], its rate, and its acceleration in the current motion, from the last evaluate_gap.
inline double gap_width(const Program& p, const Workspace& w, int gap) {
    return w.now.values[p.gaps[gap].block].residual[0];
}
inline double gap_rate(const Program& p, const Workspace& w, int gap) {
    return w.now.values[p.gaps[gap].block].rate[0];
}
double gap_acceleration(const Program& p, const Workspace& w, int gap);
// Rounding error of the gap acceleration.
double acceleration_rounding(const Program& p, const Workspace& w, int gap);

// Check if two gaps are between the same two bodies.
bool same_bodies(const Program& p, int gap, int other);
// Check if two gaps are duplicate declarations.
bool are_duplicates(const Program& p, int gap, int other);
// Check if two gaps coincide up to rounding: same bodies, same line of action, same friction point and same laws. The rows
// of the gaps and of their slip directions must be evaluated.
bool coincide(const Program& p, const Workspace& w, int gap, int other);
// Reduce a list of touching gaps to one gap per place: the one that precedes the others, in sorted order.
using Precedence = std::function<bool(int gap, int other)>;
void remove_coincident(const Program& p, const Workspace& w, std::vector<int>& list, const Precedence& precedes);
// Check if a gap has a lower bias than another gap, which coincides with it. The accelerations of such gaps differ by their
// biases only, so that a load on the first gap keeps the other open.
bool opens_later(const Program& p, const Workspace& w, int gap, int other);

// Normal force of a closed contact in the current motion. Redundant contacts have their minimum-norm compressive loads.
double load(const Program& p, Workspace& w, int gap);
// Rounding error of the normal force.
double load_rounding(const Program& p, const Workspace& w, int gap);
// Return the contact with the largest tension in the current motion, or -1 if all contacts can be in compression.
// Redundant contacts have minimum-norm loads here.
int pulling_contact(const Program& p, Workspace& w);

}  // namespace pn
