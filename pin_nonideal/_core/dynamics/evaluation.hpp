// Evaluation of Eq. (40) at one state: kinematics, rows, M and its factor, given forces, laws, acceleration.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct EvaluationParameters {
    // Pivots of M that differ by more than this factor reduce the accuracy of the row equations by the same factor.
    // Causes are bodies of very unequal mass or without mass. Refinement restores the accuracy.
    double refined_pivot_ratio = 1e6;
    // A configuration with a larger inertia [kg m^2] has diverged.
    double runaway_inertia = 1e30;
    // Rounding error of balanced forces, relative to the acceleration of gravity.
    double balance_rounding = 1e-14;
    // Rounding error of a sum, relative to the sum of the magnitudes of its terms.
    double residual_sum_rounding = 1e-13;
    // Evaluations between two checks of signals and wall time. One evaluation of a large scene takes milliseconds.
    long evaluations_per_watch = 16;
};

inline constexpr EvaluationParameters evaluation_parameters{};

// Acceleration a and multipliers lam at (t, q, v) for the modes and active rows in the workspace.
void evaluate(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

// Compute all terms that depend on the configuration: placements, M and the rows, with their factors. A user's own A
// may depend on v. Then a change of v evaluates A again (configure_velocity).
void configure(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Compute placements, M and the rows without their factors.
void place(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void configure_velocity(const Program& p, Workspace& w, double t, const VecX& v);
// Compute all terms that depend on the velocity: bias and given forces F and b, then C, a and lam.
void assemble_forces(const Program& p, Workspace& w, double t, const VecX& v);
void solve_dynamics(const Program& p, Workspace& w, double t, const VecX& v);

// Update kinematics and rows. The other functions update rows for given placements, rows for given placements and
// velocities, and residuals of the constraints only.
void update_kinematics(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
void place_rows(const Program& p, Workspace& w, double t, const VecX& v);
void evaluate_rows(const Program& p, Workspace& w, double t, const VecX& v);
void evaluate_residuals(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

// Return the width of a gap [m, rad] for given placements. A gap that was never evaluated, and is open, keeps no values.
double measured_width(const Program& p, Workspace& w, double t, const VecX& v, int gap);
// Evaluate the row of an open or closed gap. measure_gap computes the residual for given placements. move_gap computes
// rate and bias for given velocities. follow_gap computes both, and evaluate_gap also A. A user's function computes all
// of them at once.
void measure_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
void move_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
void follow_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
void evaluate_gap(const Program& p, Workspace& w, double t, const VecX& v, int gap);
// Evaluate the rows of any block for given placements and velocities.
void evaluate_block(const Program& p, Workspace& w, double t, const VecX& v, int block);
// Evaluate rates and biases of an evaluated block at another velocity.
void move_block(const Program& p, Workspace& w, double t, const VecX& v, int block);

// Compute the largest residual and rate over all described rows at the state last evaluated. A contact that may open
// contributes its penetration, and its rate only if it is closed. `open_gaps` marks the open gaps (by index) to skip.
void violations(const Program& p, Workspace& w, double t, const VecX& v, double& position, double& velocity,
                const std::vector<char>* open_gaps = nullptr);

}  // namespace pn
