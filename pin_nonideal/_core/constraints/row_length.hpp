// How long rows are in a mechanism: the scale in which it is judged whether a row adds to others.
#pragma once

#include <vector>

#include "constraints/row_system.hpp"

namespace pn {

// The greatest length in the metric of M^-1 that each of these rows of a block could have: of a row of two bodies over all directions
// of its force and couple at its point, so that one that the joints leave no freedom at this pose is short beside it;
// of a row of coordinates its own.
void greatest_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                      const RowValues& values, double* length);

}  // namespace pn
