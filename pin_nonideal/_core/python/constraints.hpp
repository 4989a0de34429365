// Constraints and directions of friction: how Python adds them, and what it may ask of their rows.
#pragma once

#include <string>
#include <vector>

#include "python/builder.hpp"

namespace pn {

// What Python may ask of the rows of a constraint or contact.
struct ConstraintRows {
    std::string name;
    int first, count;             // among the rows of all descriptions
    std::vector<bool> holonomic;  // each of them: a position stands behind it
    bool moves_in_time;           // by itself, or a function of the user says how
    Shown shown;                  // what a replay shows of it
};
std::vector<ConstraintRows> constraint_rows(const Program& p);

void bind_constraints(nb::module_& m, nb::class_<Builder>& builder);

}  // namespace pn
