// All solutions of the implicit reaction equation, or the proof that there is at most one.
#pragma once

#include <vector>

#include "complementarity/fixed_point/equation.hpp"

namespace pn {

struct ReactionRoots {
    std::vector<VecX> y;
    bool complete = true;  // all solutions were found (else: results of Newton's method from several starts)
    bool at_edge = false;  // a solution lies at infinity, or where two merge and vanish (not distinguished)
};

// Compute all solutions. The unit box of all y >= 0, finite or not, is bisected until interval forms of Newton's method
// prove that each part holds one solution or none. Unknowns among which the image contracts follow the others, so that
// only a few are bisected. The result is not complete if these unknowns, or the parts, are too many.
ReactionRoots all_roots(const ReactionEquation& equation);

}  // namespace pn
