// All solutions of the implicit reaction equation, or the proof that there is none or only one.
#pragma once

#include <vector>

#include "complementarity/fixed_point/equation.hpp"

namespace pn {

struct ReactionRoots {
    std::vector<VecX> y;
    bool complete = true;  // these are all; else what Newton's method found from several starts
    bool at_edge = false;  // one lies at infinity, or where two become none: it cannot be told which
};

// Halves the unit box of all y >= 0, finite or not, until interval forms of Newton's method tell of each part that it
// holds one solution or none. Unknowns among which the image contracts follow the others, so that only a few are halved;
// where they would be too many, or the parts, it is not complete.
ReactionRoots all_roots(const ReactionEquation& equation);

}  // namespace pn
