// Constraints and friction directions: bindings that add them, and properties of their rows.
#pragma once

#include <string>
#include <vector>

#include "python/builder.hpp"

namespace pn {

// Properties of the rows of a constraint or contact.
struct ConstraintRows {
    std::string name;
    int first, count;             // first row and number of rows, among all descriptions
    std::vector<bool> holonomic;  // per row: true for a position constraint
    bool moves_in_time;           // explicitly, or through a user function
    DisplayKind shown;                  // display kind in a replay
};
std::vector<ConstraintRows> constraint_rows(const Program& p, const std::vector<int>& blocks);
// Names of the blocks of constraints and contacts, and the first row of each among all descriptions.
std::vector<std::string> block_names(const Program& p);
std::vector<int> first_rows(const Program& p);
// Blocks of the gaps that a floating joint of one body alone moves. Their rows vanish nowhere.
std::vector<int> free_gaps(const Program& p);

void bind_constraints(nb::module_& m, nb::class_<Builder>& builder);

}  // namespace pn
