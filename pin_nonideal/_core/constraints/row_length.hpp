// Characteristic lengths of rows, in which their rank is judged.
#pragma once

#include <vector>

#include "constraints/row_system.hpp"

namespace pn {

// Compute the greatest length that each of these rows of a block could have in the metric of M^-1. For a row between two
// bodies, it covers all directions of the force and couple at the row's point. The row itself may be shorter at this pose,
// if the joints leave it no freedom. For a row of coordinates, it is the row's own length, with a small part of the longest
// row of the block as lower bound. Rows of a function that are rounding error relative to its longest row count as zero.
void greatest_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                      const RowValues& values, double* length);

// Compute the length of each of these rows of a block in the metric of M^-1.
void own_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                 const RowValues& values, double* length);

}  // namespace pn
