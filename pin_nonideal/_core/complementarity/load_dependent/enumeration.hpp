// All solutions of the rest equation (equation.hpp) of a few friction forces, by intervals. Boxes without a solution
// are dropped, boxes with one solution are recognized by Krawczyk's test, and other boxes are bisected. Unbounded
// forces need no special case: in (x, tau), with the forces x / tau, the equation is homogeneous.
#pragma once

#include "complementarity/load_dependent/equation.hpp"

namespace pn {

struct EnumerationParameters {
    double box_overlap = 1.05;            // boxes overlap, so that no solution lies on a border
    double min_box_part = 1e-9;           // smaller boxes stay undecided
    double radius_rounding = 1e-14;       // rounding in a box, added to its radius
    double infinite_solution_tau = 1e-9;  // tau of a solution at infinity
    double same_motion = 1e-7;            // relative difference below which forces are equal
    double max_shrink_ratio = 0.8;        // reduction of a box's widest side that justifies another pass
    double min_pivot = 1e-10;             // pivot of W relative to its diagonal
    int max_undecided = 100;              // undecided boxes that end the search
    int max_boxes = 20000;                // maximum number of boxes, which bounds the time of a search
};

inline constexpr EnumerationParameters enumeration_parameters{};

// Maximum number of forces of a problem that is searched.
constexpr int max_searched_forces = 6;

struct AllMotions {
    std::vector<VecX> forces;  // forces of each solution
    bool complete = false;     // no box was left undecided, so there are no other solutions
};

// Check if the equation has few forces, a regular W, and loads that are linear in the forces.
bool is_searched(const RestEquation& equation);
// Compute all solutions. The result is empty and not complete if the equation cannot be searched.
AllMotions all_motions(const RestEquation& equation);

}  // namespace pn
