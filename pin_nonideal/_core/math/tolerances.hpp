// Tolerances that several rooms of the core share. Other tolerances are defined beside their algorithm.
//
// The unit roundoff is 1e-16. A relative tolerance is this roundoff times the number of operations, or times the
// condition number of the value.
#pragma once

namespace pn {

// --- Rows of constraints
// Rank tolerance on the pivots of B^T, with each row divided by its greatest length. On the manifold, rounding and
// constraint drift reach about 1e-12. True directions of light mechanisms lie above 1e-7.
constexpr double rank_tolerance = 1e-10;
// Smallest pivot of the rows' unit-diagonal factor at a position that is not near a singular position. The pivot is the
// squared sine of the angle between the nearest row and the other rows: 3 degrees.
constexpr double near_singular_pivot = 2.5e-3;
// Smallest entry of a row that shares a load in a unit null-space vector of multipliers.
constexpr double min_null_space_entry = 1e-9;

// --- Projection onto the constraints
// Residual that is rounding error, relative to the scene's size: a few hundred operations of unit roundoff.
constexpr double projection_floor = 2e-14;
// Largest gap after a successful projection, relative to the scene's size. Projection closes gaps to rounding after every
// step, in singular positions too.
constexpr double max_projected_gap = 1e-9;
// Largest velocity [rad/s or m/s] of a scene without freedom that counts as rounding error of the last event.
constexpr double immobile_speed = 1e-8;

// --- Slip. Speeds are relative to 1 + the largest speed of the scene [rad/s or m/s].
// Slip speed that counts as rest: event location leaves such rounding errors.
constexpr double rest_speed = 1e-11;
// Slip speed below which rounding errors determine the slip direction.
constexpr double min_directed_speed = 1e-9;

// --- Forces and accelerations
// Rounding error of accelerations, relative to their scale.
constexpr double relative_acceleration_rounding = 1e-12;
// Acceleration of a tree at rest that counts as rounding error, relative to the acceleration without forces.
constexpr double tree_acceleration_rounding = 1e-9;
// Minimum response to a force under constraints, relative to its free response. Smaller responses are rounding error.
constexpr double min_constrained_response = 1e-13;
// Impulse that is rounding error, relative to the largest impulse of an impact.
constexpr double impulse_rounding = 1e-14;

// --- Gaps
// Width of a gap below which its contact touches [m or rad]. Penetrations after a step are compared with this width times
// the scene's size.
constexpr double touching_width = 1e-12;
// Minimum difference of the biases of two gaps, or of one gap before and after a hand-over, relative to all accelerations.
constexpr double min_bias_jump = 1e-6;

// --- Any quantity
// Divisor in place of a smaller scale, such as the limit of an element without load. Quotients stay finite.
constexpr double min_scale = 1e-300;

}  // namespace pn
