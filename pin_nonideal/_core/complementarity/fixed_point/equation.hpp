// The implicit reaction equation of dry friction as arrays. y holds the limit of each slipping element. The motion is
// affine in y and a load is a sum of lengths of vectors, so that
//     y_i = g_i(y) = c_i + sum_k |b_k + P_k y|,
// which is convex and smooth but where a vector vanishes. Written for (y s, s) it is homogeneous of degree one.
#pragma once

#include <vector>

#include "math/decompositions.hpp"

namespace pn {

struct ReactionEquation {
    VecX constant;             // c
    std::vector<int> element;  // of each vector
    MatX offset;               // b_k, (3, vectors)
    MatX columns;              // P_k one below the other, (3 vectors, elements)
    // Vectors that count by their first component, with its sign: loads of contacts that may open, beyond which friction
    // goes through zero. All solutions are found as if they were lengths.
    std::vector<char> directed;

    // For a number of elements and vectors.
    void resize(int size, int vectors);
    int size() const { return static_cast<int>(constant.size()); }
    int vectors() const { return static_cast<int>(element.size()); }
    Eigen::Vector3d vector(int k, const VecX& y, double s) const;
    void image(const VecX& y, double s, VecX& g) const;
    // dg/dy; nothing of a vector that vanishes.
    void slope(const VecX& y, double s, MatX& J) const;
    // L: the largest |dg_i/dy_j| over all y.
    void steepest(MatX& L) const;
    // The same in s: what the limits are where friction causes no load.
    VecX steepest_in_s() const;
    bool finite() const;
};

// Newton's method on the arrays; the storage is kept.
struct ReactionNewton {
    MatX matrix;  // I - dg/dy
    LU factor;
    VecX image, residual, step;

    // At a point; returns the determinant.
    double factorize(const ReactionEquation& equation, const VecX& y);
    // y becomes the solution to which the method leads from it; false where it leads to none.
    bool solve(const ReactionEquation& equation, VecX& y);
};

// A bound on the largest eigenvalue of a matrix without negative entries, exact in the limit. Below 1 for L the image g
// contracts, in lengths with positive weights: then there is one solution.
double growth(const MatX& L);

}  // namespace pn
