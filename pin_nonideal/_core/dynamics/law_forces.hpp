// Forces of smooth laws and user laws at one state: their part of C, Eq. (9), and of the joint reactions.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Evaluate the force of a user's law for the reactions in the workspace. Store it in w.now.user_C and return it.
const VecX& user_law_force(const Program& p, const UserLaw& law, Workspace& w, double t, const VecX& q, const VecX& v);
// Add C of each law that does not read reactions.
void add_smooth_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& C);
// Dofs on which each law can act in any configuration, ascending.
std::vector<std::vector<int>> law_supports(const Program& p);
// Add C of each law at the evaluation in the workspace to the entry of that law.
void add_forces_by_law(const Program& p, const Workspace& w, const VecX& v, LawForceList& force);
// Add C of all laws without modes at the evaluation in the workspace. No function of a user is called.
void add_law_forces(const Program& p, const Workspace& w, const VecX& v, VecX& C);
// Add the forces of smooth laws on bodies to `body`, the forces that the joints carry.
void add_body_forces(const Program& p, const Workspace& w, std::vector<Force>& body);

}  // namespace pn
