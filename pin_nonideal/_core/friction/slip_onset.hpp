// Modes of elements at rest under given forces. An element below its limit sticks. The other elements slip along their
// accelerations, or along the accelerations slightly past the load of their common slip onset.
#pragma once

#include "complementarity/load_dependent/equation.hpp"
#include "friction/mode_question.hpp"
#include "friction/problem.hpp"

namespace pn {

constexpr double slip_limit_rounding = 1e-13;    // rounding relative to a limit
constexpr double limit_slack = 1e-9;             // allowed violation of a mode's condition, relative to a limit

// Compute the modes for the forces f of a program with these limits. Slip directions are stored in the workspace.
std::vector<Mode> modes_of(Workspace& w, const ModeQuestion& question, const FrictionProblem& problem, const VecX& f,
                           const FrictionLimits& limits);
// Compute the modes for a solution x of the load-dependent equation, as accurate as its residual.
std::vector<Mode> modes_of(Workspace& w, const ModeQuestion& question, const RestEquation& equation, const VecX& x);

}  // namespace pn
