// What the smooth laws and the user's exert at one state: their part of C, Eq. (9), and of what joints carry.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// The force of a user's law, for the reactions that the workspace holds: into w.now.user_C, and to its caller.
const VecX& ask(const Program& p, const UserLaw& law, Workspace& w, double t, const VecX& q, const VecX& v);
// Adds C of every law that does not read reactions.
void add_smooth_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& C);
// Dofs on which each law acts, wherever the mechanism is, ascending.
std::vector<std::vector<int>> law_supports(const Program& p);
// Adds C of each law at the evaluation in the workspace to that of its column.
void add_forces_by_law(const Program& p, const Workspace& w, const VecX& v, std::vector<VecX>& force);
// Adds the forces of smooth laws on bodies to those that the joints carry.
void add_body_forces(const Program& p, const Workspace& w, std::vector<Force>& body);

}  // namespace pn
