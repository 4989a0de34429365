// All solutions of the rest equation of a few forces, by intervals. Boxes without a solution are dropped, boxes with
// one solution are recognized by Krawczyk's test, and other boxes are bisected. Unbounded forces need no special case:
// in (x, tau), with the forces x / tau, the equation is homogeneous.
#pragma once

#include "complementarity/load_dependent/equation.hpp"

namespace pn {

// Maximum number of forces of a problem that is searched.
constexpr int most_searched = 6;

struct AllMotions {
    std::vector<VecX> forces;  // forces of each solution
    bool complete = false;     // no box was left undecided, so there are no other solutions
};

// Check if the equation has few forces, which W distinguishes, and loads linear in them.
bool is_searched(const RestEquation& equation);
// Compute all solutions. The result is empty and not complete if the equation cannot be searched.
AllMotions all_motions(const RestEquation& equation);

}  // namespace pn
