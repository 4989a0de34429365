// Contacts that may open: their gaps, how these move, and the loads that closed ones carry.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Part of the scene's size [m] by which rounding may miss a gap that is closed.
constexpr double gap_rounding = 1e-14;

// Whether nothing moves along the normal: such a contact never closes.
inline bool is_bare(const Program& p, int gap) { return p.blocks[p.gaps[gap].block].kept.empty(); }

// Of a gap, as evaluate_gap has left it: its width [m or rad], the rate, and the rate of that in the motion at hand.
inline double gap_width(const Program& p, const Workspace& w, int gap) {
    return w.now.values[p.gaps[gap].block].residual[0];
}
inline double gap_rate(const Program& p, const Workspace& w, int gap) {
    return w.now.values[p.gaps[gap].block].rate[0];
}
double gap_acceleration(const Program& p, const Workspace& w, int gap);
// Part of that which may be rounding.
double acceleration_rounding(const Program& p, const Workspace& w, int gap);

// Whether two gaps are one, declared twice.
bool are_copies(const Program& p, int gap, int other);
// Whether two gaps are those of one place: between the same bodies along one line, and rubbing the same way at one point,
// but for rounding. Their rows and those of their sliding are evaluated.
bool coincide(const Program& p, const Workspace& w, int gap, int other);
// Of those listed, which touch, leaves one of each place: one of those that are `closed`, or else the first.
void leave_one_of_each_place(const Program& p, const Workspace& w, const std::vector<char>& closed, std::vector<int>& list);

// Normal force of a closed contact in the motion at hand; among redundant rows the least-norm one of those that press.
double load(const Program& p, Workspace& w, int gap);
// Part of it that may be rounding.
double load_rounding(const Program& p, const Workspace& w, int gap);
// The contact that has to pull in the motion at hand, or among redundant ones pulls most in the least-norm split where
// none presses everywhere; -1 where all can press.
int pulling_contact(const Program& p, Workspace& w);

}  // namespace pn
