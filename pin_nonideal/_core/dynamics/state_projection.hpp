// Projection of a whole state onto the constraints, also if rows depend on each other or none are chosen yet. Each
// projection that returns a bool returns false if nothing had to move.
#pragma once

#include <climits>

#include "dynamics/projection.hpp"

namespace pn {

struct StateProjectionParameters {
    // Rank tolerances tried in this order at a state off the constraints, where dependent rows have pivots above
    // rank_tolerance. The first choice (fewest rows) whose projection closes all other rows is taken.
    double tolerances_near[4] = {1e-3, 1e-5, 1e-7, 1e-9};
    // Gaps above this fraction of the scene's size in dependent rows are closed by projection, which may move sticking
    // elements.
    double creeping_gap = 1e-11;
    // Maximum number of choices of rows for the projection of one position. Each choice reduces the gaps of the other
    // rows quadratically.
    int max_row_choices = 3;
};

inline constexpr StateProjectionParameters state_projection_parameters{};

// Project q and v. On return the workspace is configured at q.
bool project(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
// Project q and v and evaluate the result.
void project_and_evaluate(const Program& p, Workspace& w, double t, VecX& q, VecX& v);

// Close the gaps of rows that count as dependent. Active rows that become short over a step magnify the residuals of
// other rows. Project onto the longest rows at this position. The number of rows is kept, because off the constraints
// dependent rows appear independent.
bool project_onto_dependent(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);
// Close the gaps of rows that count as dependent while elements stick. Sticking elements hold these rows with fractions of
// their forces below rank_tolerance_sticking, and creep by the same ratio.
bool project_past_sticking(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);

// Choose rows at a state near the constraints without rows from an earlier step, and project the position onto them.
// The workspace must be configured at this state. `max_rank`: rank on the constraints, if known. Off them dependent rows
// seem independent.
bool choose_rows_near(const Program& p, Workspace& w, double t, VecX& q, const VecX& v, int max_rank = INT_MAX);

// Project a state without factors from an earlier step. Uses the factors and independent rows at the state itself, with
// all elements slipping.
void project_anew(const Program& p, Workspace& w, double t, VecX& q, VecX& v);
// Project such a state unless its largest residual exceeds `max_residual`. Return the residual before and after, and the
// largest rate.
struct Closure { double before, after, rate; };
Closure close(const Program& p, Workspace& w, double t, VecX& q, VecX& v, double max_residual);

}  // namespace pn
