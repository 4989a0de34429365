// All solutions of the equation of rest of a few forces, by intervals: boxes that hold none are dropped, boxes that hold
// just one are recognized by Krawczyk's test, others are halved. Forces without bound are boxes like any other, since in
// (x, tau), with tau x the forces, everything is homogeneous.
#pragma once

#include "complementarity/load_dependent/equation.hpp"

namespace pn {

// Forces of one problem that may be searched.
constexpr int most_searched = 6;

struct AllMotions {
    std::vector<VecX> forces;  // of each solution
    bool complete = false;     // no box was left undecided: there are no others
};

// Whether it has few forces that are told apart, and loads linear in them.
bool is_searched(const RestEquation& equation);
// Not complete, and empty, where it is not searched.
AllMotions all_motions(const RestEquation& equation);

}  // namespace pn
