// Modes of elements at rest under given forces. An element below its limit sticks. The other elements slip along their
// accelerations, or along the accelerations slightly past the load of their common slip onset.
#pragma once

#include "complementarity/load_dependent/equation.hpp"
#include "friction/mode_query.hpp"
#include "friction/problem.hpp"

namespace pn {

struct SlipOnsetParameters {
    double residual_to_acceleration = 10.0;  // factor from the residual of the equation to the error of accelerations
    double max_acceleration = 1e-6;          // accelerations below this fraction are slip onset exactly at a limit
    double limit_rounding = 1e-13;           // rounding error relative to a limit
    double condition_slack = 1e-9;           // allowed violation of a mode's condition, relative to a limit
};

inline constexpr SlipOnsetParameters slip_onset_parameters{};

// Check if an element that just reached its limit is at its limit under forces x, so that rest does not last.
bool any_breaks(const ModeQuery& query, const RestEquation& equation, const VecX& x);
// Compute the modes for the forces f of a program with these limits. Slip directions are stored in the workspace.
std::vector<Mode> modes_of(Workspace& w, const ModeQuery& query, const FrictionProblem& problem, const VecX& f,
                           const FrictionLimits& limits);
// Compute the modes for a solution x of the load-dependent equation, as accurate as its residual.
std::vector<Mode> modes_of(Workspace& w, const ModeQuery& query, const RestEquation& equation, const VecX& x);

}  // namespace pn
