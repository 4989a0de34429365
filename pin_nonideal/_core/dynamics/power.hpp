// Forces of the laws and power of all forces at the evaluation in the workspace. The ledger integrates the power.
#pragma once

#include <iterator>
#include <string>
#include <vector>

#include "dynamics/workspace.hpp"

namespace pn {

// Columns: these powers, then one for each law.
constexpr const char* scene_powers[] = {"actuation", "forces", "constraints"};
constexpr int constraint_power = 2;
constexpr int first_law_power = std::size(scene_powers);
int power_count(const Program& p);
std::vector<std::string> power_names(const Program& p);
// Compute C of each law, sticking forces included. The sum over the laws is C of the decomposition.
void law_forces(const Program& p, Workspace& w, const VecX& v, LawForceList& force);
void powers(const Program& p, Workspace& w, const VecX& v, double* out);

}  // namespace pn
