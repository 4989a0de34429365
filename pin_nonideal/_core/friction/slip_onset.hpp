// What elements at rest begin to do under the forces found for them: what is below its limit sticks, the others go the way
// that their accelerations tell, or those a little beyond the load at which they give way together.
#pragma once

#include "friction/problem.hpp"
#include "complementarity/load_dependent/equation.hpp"

namespace pn {

constexpr double at_limit = 1e-13;         // part of a limit by which rounding may miss it
constexpr double limit_slack = 1e-9;       // part of a limit by which a mode may miss its condition by rounding
constexpr double no_acceleration = 1e-12;  // part of the accelerations in play that is rounding

// Modes to be found: those of elements that move are known, the others are at rest along their directions.
struct ModeQuestion {
    std::vector<Mode> modes;  // of all elements; what those at rest hold is no matter
    std::vector<int> at_rest;
    std::vector<int> breaking;  // of those at rest: stuck until now and has just reached its limit, so that it slips as
                                // soon as its force is at the limit, though its acceleration is still zero
    bool answered = false;      // `modes` are those of a motion that was found with all contacts together
    std::vector<Vec3> near;     // friction of all elements in a motion that is near, where one is known
};
// Under forces f of a program for these limits. Directions of slip stay in the workspace.
std::vector<Mode> modes_of(Workspace& w, const ModeQuestion& question, const FrictionProblem& problem, const VecX& f,
                           const FrictionLimits& limits);
// The same of a solution of the equation of rest, which is as exact as what it lacks.
std::vector<Mode> modes_of(Workspace& w, const ModeQuestion& question, const RestEquation& equation, const VecX& x);

}  // namespace pn
