// Power of the forces at the evaluation in the workspace: what the ledger integrates.
#pragma once

#include <iterator>
#include <string>
#include <vector>

#include "dynamics/workspace.hpp"

namespace pn {

// Columns: these, and from there on each law.
constexpr const char* scene_powers[] = {"actuation", "forces", "constraints"};
constexpr int first_law_power = std::size(scene_powers);
int power_count(const Program& p);
std::vector<std::string> power_names(const Program& p);
void powers(const Program& p, Workspace& w, const VecX& v, double* out);

}  // namespace pn
