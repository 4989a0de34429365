// Characteristic lengths of rows, in which their rank is judged.
#pragma once

#include <vector>

#include "constraints/system.hpp"

namespace pn {

// Greatest length that each of these rows of a block could have in the metric of M^-1. For a row between two bodies it is
// taken over all directions of its force and couple at its point; the row itself may be shorter at this pose, where the
// joints leave it no freedom. For a row of coordinates it is the row's own length, or a small part of that of the longest
// row of its block: a row that is rounding beside others of the same function is none.
void greatest_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                      const RowValues& values, double* length);

// Length of each of these rows of a block in the metric of M^-1.
void own_lengths(const Mechanism& m, Terms& terms, const Block& block, const std::vector<int>& rows,
                 const RowValues& values, double* length);

}  // namespace pn
