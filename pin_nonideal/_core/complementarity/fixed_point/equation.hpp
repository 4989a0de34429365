// Implicit reaction equation of dry friction as arrays. y holds the limit of each slipping element. The motion is
// affine in y, and a load is a sum of lengths of vectors, so that
//     y_i = g_i(y) = c_i + sum_k |b_k + P_k y|.
// The function g is convex, and smooth except where a vector vanishes. Written for (y s, s) it is homogeneous of degree one.
#pragma once

#include <vector>

#include "math/decompositions.hpp"

namespace pn {

struct SpectralBoundParameters {
    int max_passes = 200;       // maximum passes of the power iteration
    double min_improved = 0.5;  // smaller bounds are not improved
    double settled = 1e-4;      // relative improvement of the bound by a pass that ends the iteration
    double kept_weight = 1e-2;  // fraction of the previous weights that stays, so that none becomes zero or alternates
};

inline constexpr SpectralBoundParameters spectral_bound_parameters{};

struct ReactionEquation {
    VecX constant;             // c
    std::vector<int> element;  // element of each vector
    MatX offset;               // b_k, (3, vectors)
    MatX columns;              // stacked P_k, (3 vectors, elements)
    // True for vectors that count by their first component, with its sign: loads of unilateral contacts, at which
    // friction goes through zero. The search for all solutions treats these vectors as lengths.
    std::vector<char> directed;

    // Set the numbers of elements and vectors.
    void resize(int size, int vectors);
    int size() const { return static_cast<int>(constant.size()); }
    int vectors() const { return static_cast<int>(element.size()); }
    Eigen::Vector3d vector(int k, const VecX& y, double s) const;
    void image(const VecX& y, double s, VecX& g) const;
    // Compute dg/dy. A vector that vanishes adds nothing.
    void slope(const VecX& y, double s, MatX& J) const;
    // Compute L, the largest |dg_i/dy_j| over all y.
    void steepest(MatX& L) const;
    // Return the same bound for the derivative in s. The entries of s are the limits if friction causes no load.
    VecX steepest_in_s() const;
    bool finite() const;
};

struct ReactionNewtonParameters {
    double tolerance = 1e-15;        // residual relative to the solution
    double stall_tolerance = 1e-12;  // accepted residual if the residual no longer falls
    // Maximum number of steps of Newton's method for a solution of the equation.
    int max_steps = 30;
};

// Newton's method on the arrays, with persistent storage.
struct ReactionNewton {
    using Parameters = ReactionNewtonParameters;
    static constexpr Parameters parameters{};

    MatX matrix;  // I - dg/dy
    LU factor;
    VecX image, residual, step;

    // Factorize I - dg/dy at y. Return the determinant.
    double factorize(const ReactionEquation& equation, const VecX& y);
    // Iterate from y to a solution. Return false if the method finds none.
    bool solve(const ReactionEquation& equation, VecX& y);
};

// Return an upper bound on the largest eigenvalue of a nonnegative matrix. Passes of the power iteration lower the
// bound to this eigenvalue. If the bound is below 1 for L, g contracts in lengths with positive weights. Then there is
// one solution.
double spectral_bound(const MatX& L);

}  // namespace pn
