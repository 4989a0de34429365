// Power of the forces at the evaluation in the workspace: what the ledger integrates.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Columns: actuation, given forces, constraints, and from here on each law.
constexpr int first_law_power = 3;
int power_count(const Program& p);
void powers(const Program& p, Workspace& w, const VecX& v, double* out);

}  // namespace pn
