// Evaluation at the start of a step, with the choice of independent rows for the step.
#pragma once

#include <climits>

#include "dynamics/workspace.hpp"

namespace pn {

struct StepStartParameters {
    // Tolerance of the residual of dependent rows, relative to the magnitudes of their terms. The scale of
    // accelerations counts with the factor `background`, and is at least `background` m/s^2.
    double consistency_tolerance = 1e-6, background = 1e-3;
    // Factor by which biases of a dependent row's basis rows may enter its own bias.
    double dependence_growth = 10.0;
    // A change of modes may take at most this fraction of the kinetic energy. If new rows would take more, the rank
    // tolerance grows by factors `unheld_growth`, up to `max_unheld_part`.
    double max_removed_energy_part = 1e-9, max_unheld_part = 1e-3, unheld_growth = 3.0;
};

inline constexpr StepStartParameters step_start_parameters{};

// Evaluate and choose the independent rows. Contradicting rows raise a failure.
void begin_step(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Evaluate in a configured workspace at another velocity. `chosen`: the rows were just chosen.
void continue_step(const Program& p, Workspace& w, double t, const VecX& v, bool chosen = false);
// Configure and choose the independent rows, at most `max_rank`, without forces. Return true if it chose rows.
bool begin_rows(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, int max_rank = INT_MAX);
// Configure at a state inside a step, off the constraints. Off the constraints dependent rows seem independent, so the rank
// is determined at the step's start (t0, q0), unless all rows were independent at an earlier start.
void begin_rows_inside(const Program& p, Workspace& w, double t0, const VecX& q0, double t, const VecX& q, const VecX& v);
// Choose the independent rows in a configured workspace, at most `max_rank`. Return true if it chose rows.
bool configure_step(const Program& p, Workspace& w, int max_rank = INT_MAX);
// Return the rank of the required rows near the start of a time step, if the same constraints depend on others there, or
// INT_MAX if none does.
int max_rank_near(const Workspace& w);
// Choose the rows in a configured workspace, project v onto A v + phi_t = 0, and evaluate. Return true if v changed.
bool begin_step_on_rates(const Program& p, Workspace& w, double t, VecX& v);
// Project v onto A v + phi_t = 0 without a choice of rows and without an evaluation.
bool meet_rates(const Program& p, Workspace& w, double t, VecX& v);
// Keep bodies moving after a change of modes. If newly chosen rows would stop the motion, rows of closed contacts and
// sticking elements that nearly depend on others count as dependent from now on. The workspace is evaluated at (q, v)
// before and after the call.
void restore_motion(const Program& p, Workspace& w, double t, const VecX& v);
// Project a state onto the rows of newly set modes, with independent rows at this state.
void project_into_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v);

}  // namespace pn
