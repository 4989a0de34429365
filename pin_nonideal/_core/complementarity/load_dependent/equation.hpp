// The equation of rest. With the friction forces x of all elements at rest as unknowns, everything but their limits is
// linear: slip accelerations are alpha = alpha0 + W x, and limits come from lengths of vectors that are linear in x. An
// element sticks (alpha = 0, |x| <= limit) or begins to slip (x = -limit alpha / |alpha|); either is
//     x = P(x - rho alpha),    P the nearest point of the ball of the limit, rho > 0 any.
// One whose slip is known (it slips already, or is driven) has x = -limit times its direction. If the limits differ
// forward and backward, the ball lies about their middle. Pure functions on arrays.
#pragma once

#include <functional>
#include <vector>

#include "complementarity/friction_limits.hpp"
#include "math/spatial.hpp"

namespace pn {

struct RestElement {
    int row = 0, dim = 1;     // of x
    bool may_stick = true;
    VecX direction;           // of its slip, where that is known
    double constant = 0.0;    // limit without any load, of an element that has begun to slip
    double middle = 0.0;      // and the middle of its limits, where it has one direction
    double factor = 1.0;      // static over kinetic limit, or 1 once it has begun to slip
    double rho = 1.0;         // of the equation: the force that an acceleration asks for
    int vector = 0, vectors = 0;  // its load: rows of `loads`, three a vector
    bool directed = false;        // the first component alone, of which nothing below zero is a load
};

struct RestEquation {
    int n = 0;
    MatX W;
    VecX alpha0;
    std::vector<RestElement> elements;
    VecX still;  // load vectors without friction,
    MatX loads;  // and for a unit of each force
    // Where laws are known only as functions: slip accelerations and limits before `factor`, asked for forces x.
    std::function<void(const VecX& x, VecX& alpha, FrictionLimits& limits)> ask;
    // Part of the limits that is as `fixed` says and not as the load does: on the way from one to the other.
    double frozen = 0.0;
    FrictionLimits fixed;

    bool loaded() const { return ask || loads.rows() > 0; }
    void respond(const VecX& x, VecX& alpha, FrictionLimits& limits) const;
    // Derivatives: of alpha (n, n), and of the limits' sizes (elements, n) and middles (n, n).
    void differentiate(const VecX& x, MatX& dalpha, MatX& dlimits, MatX& dmiddle) const;
    // What x lacks, row by row; and the largest of it as part of each element's forces.
    VecX residual(const VecX& x) const;
    double error(const VecX& x) const;
    // The largest of an element's force and limit and of what would stop it.
    double force_in_play(size_t element, const VecX& x, const FrictionLimits& limits) const;
    // d residual / dx on the branch that x is on.
    MatX jacobian(const VecX& x) const;

    // Forces under which nothing at rest accelerates, whatever the limits; the least where redundant elements share.
    VecX holding_forces() const;
    // Which elements stick in the motion with forces x, a solution.
    std::vector<bool> sticks(const VecX& x) const;
    // det(I - d limits / d limits) of the implicit equation of the elements that slip there.
    double determinant(const VecX& x) const;
    // The least that it comes to under forces without end, whichever way all slip.
    double determinant_far_away() const;
};

// Where below 1: the motion is unique, and the limits of any two motions differ by this part of what they differ by in
// turn. With W = G G^T and u = G^T (x - y) for two solutions x, y, |u|^2 <= sum_i |G_i u| |limit_i(x) - limit_i(y)|,
// and |limit_i(x) - limit_i(y)| <= l_i |u|.
double contraction(const RestEquation& equation);

}  // namespace pn
