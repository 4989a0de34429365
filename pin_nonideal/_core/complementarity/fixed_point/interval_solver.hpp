// All solutions of the implicit reaction equation, or the proof that there is at most one.
#pragma once

#include <vector>

#include "complementarity/fixed_point/equation.hpp"

namespace pn {

struct IntervalSolverParameters {
    int max_bisected = 3;               // bisected unknowns
    double max_work = 20000.0;          // maximum number of parts of the box, weighted by the size of the matrices
    double max_followed_growth = 0.9;   // largest spectral bound of the unknowns that are not bisected
    double min_box_part = 1e-7;         // smallest part of the box (its square is rounding error, where two solutions merge)
    double alone = 0.9;                 // size to which Newton's interval form must shrink a part, relative to it
    double margin = 1e-9;               // relative enlargement of a part and its bounds
    double residual_tolerance = 1e-13;  // residual relative to its terms
    double same_root = 1e-9;            // relative distance of equal solutions
    double min_determinant = 1e-8;      // smaller determinants count as zero
    double infinite_solution_scale = 1e-9;  // s below which a solution counts as infinite
    double far_newton_start = 100.0;  // start of Newton's method beyond the bends of g
    // Maximum passes for the unknowns that are not bisected: 350 passes with a factor 0.9 reach rounding error.
    int max_follow_passes = 1000;
};

struct ReactionRoots {
    std::vector<VecX> y;
    bool complete = true;  // all solutions were found (else: results of Newton's method from several starts)
    bool at_edge = false;  // a solution lies at infinity, or where two merge and vanish (not distinguished)
};

// Compute all solutions. The unit box of all y >= 0, finite or not, is bisected until interval forms of Newton's method
// prove that each part holds one solution or none. Unknowns among which the image contracts are computed from the
// others, so that only a few unknowns are bisected. The result is not complete if too many unknowns are bisected, or if
// too many parts remain.
ReactionRoots all_roots(const ReactionEquation& equation);

}  // namespace pn
