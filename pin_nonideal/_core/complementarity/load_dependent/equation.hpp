// Rest equation: the equation of friction at rest. The unknowns are the friction forces x of all elements at rest. Slip
// accelerations are alpha = alpha0 + W x, and limits come from lengths of vectors that are linear in x. An element
// sticks (alpha = 0, |x| <= limit) or begins to slip (x = -limit alpha / |alpha|). In both cases
//     x = P(x - rho alpha),    P the projection on the ball of radius limit, any rho > 0.
// If the slip of an element is known (the element slips already, or is driven), x = -limit times its direction. If the
// limits differ forward and backward, the ball is centered at their middle. Pure functions on arrays.
#pragma once

#include <functional>
#include <vector>

#include "complementarity/friction_limits.hpp"
#include "math/spatial.hpp"

namespace pn {

struct RestElement {
    int row = 0, dim = 1;     // rows of x
    bool may_stick = true;
    VecX direction;           // direction of its slip, if known
    double constant = 0.0;    // limit of a slipping element without load
    double middle = 0.0;      // middle of its limits, if it has one direction
    double factor = 1.0;      // ratio of the static to the kinetic limit, or 1 once it has begun to slip
    double rho = 1.0;         // rho of the equation: force per acceleration
    int vector = 0, vectors = 0;  // rows of its load in `loads`, three per vector
    bool directed = false;        // only the first component counts, and only if positive
};

struct RestEquationParameters {
    double difference_step = 1e-7;     // relative to the forces: square root of the rounding error, with a margin
    double min_response_pivot = 1e-8;  // pivot of the Cholesky factor of W, relative to its diagonal
    double null_response = 1e-13;      // eigenvalues of W below this fraction of the largest count as zero
    double unmoved = 1e-9;             // fraction of the loads that forces without motion may change
    double limit_rounding = 1e-9;      // relative excess of a sticking force over its limit
    double unbounded_force = 1e9;      // unbounded forces, relative to those of limits and accelerations
    int max_signed_elements = 6;       // elements with all combinations of slip signs
};

struct RestEquation {
    using Parameters = RestEquationParameters;
    static constexpr Parameters parameters{};

    int n = 0;
    MatX W;
    VecX alpha0;
    std::vector<RestElement> elements;
    VecX still;  // load vectors without friction,
    MatX loads;  // and per unit of each force
    // Set if laws are known only as functions: computes slip accelerations, and limits before `factor`, for the forces x.
    std::function<void(const VecX& x, VecX& alpha, FrictionLimits& limits)> evaluate_laws;
    // Fraction of the limits that comes from `fixed` instead of the load (continuation parameter).
    double frozen = 0.0;
    FrictionLimits fixed;

    bool is_load_dependent() const { return evaluate_laws || loads.rows() > 0; }
    void respond(const VecX& x, VecX& alpha, FrictionLimits& limits) const;
    // Compute derivatives of alpha (n, n), of the limits' sizes (elements, n) and of their middles (n, n).
    void differentiate(const VecX& x, MatX& dalpha, MatX& dlimits, MatX& dmiddle) const;
    // Residual of the equation at x per row, and its largest value relative to each element's forces.
    VecX residual(const VecX& x) const;
    double error(const VecX& x) const;
    // Return the largest of an element's force, of its limit and of the force that would stop it.
    double force_scale(size_t element, const VecX& x, const FrictionLimits& limits) const;
    // Return d residual / dx on the branch of x.
    MatX jacobian(const VecX& x) const;

    // Return forces under which no element at rest accelerates, for any limits. Redundant elements share with minimum norm.
    VecX holding_forces() const;
    // Return the sticking elements in the motion with forces x, a solution.
    std::vector<bool> sticks(const VecX& x) const;
    // Return det(I - d limits / d limits) of the implicit equation of the elements that slip under x.
    double determinant(const VecX& x) const;
    // Return the least value of this determinant under unbounded forces, over all slip signs.
    double determinant_far_away() const;
};

// Return a bound on the contraction of the limits. If it is below 1, the motion is unique: the difference of the limits
// of two motions would shrink by this factor. With W = G G^T and u = G^T (x - y) for two solutions x, y, |u|^2 <= sum_i |G_i
// u| |limit_i(x) - limit_i(y)|, and |limit_i(x) - limit_i(y)| <= l_i |u|.
double contraction_bound(const RestEquation& equation);

}  // namespace pn
