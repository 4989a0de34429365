// What rows that say the same carry each, where the motion tells only their sum.
#pragma once

#include "constraints/row_factor.hpp"

namespace pn {

// Multipliers of least norm among redundant rows (in the user's row scale) for those of the rows in use.
void share_multipliers(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                       RowSystem& s, const VecX& lam, VecX& shared);

}  // namespace pn
