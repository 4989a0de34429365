// Factorizations of dense matrices by Eigen. One source instantiates the templates, because each use takes seconds to
// compile.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "math/spatial.hpp"

namespace pn {

// Factorization A = L L^T of a symmetric positive definite matrix.
class Cholesky {
public:
    // Return false if A is not positive definite to rounding. L is then undefined.
    bool compute(const MatX& A);
    // Matrix with L in its lower triangle. The entries above the diagonal equal the entries of A.
    const MatX& factor() const { return factor_.matrixLLT(); }
    // Solve A x = b. Allocates nothing if x has the right size.
    void solve(const VecX& b, VecX& x) const;
    // Solve L X = B for X.
    MatX solve_lower(const MatX& B) const;

private:
    Eigen::LLT<MatX> factor_;
};

// Factorization P A = L U of a square matrix with partial pivoting. If A is singular, the results are infinite, and no
// error is raised.
class LU {
public:
    void compute(const MatX& A);
    double determinant() const;
    // Estimate of 1 / (|A| |A^-1|) in the 1-norm.
    double reciprocal_condition() const;
    // Solve A x = b. Allocates nothing if x has the right size.
    void solve(const VecX& b, VecX& x) const;

private:
    Eigen::PartialPivLU<MatX> factor_;
};

// Solution of A x = b, determinant |A| and inverse A^-1, by LU.
VecX solve(const MatX& A, const VecX& b);
double determinant(const MatX& A);
MatX inverse(const MatX& A);

// Compute the minimum-norm x that minimizes |A x - b|. Pivots below `threshold` of the largest count as zero.
VecX least_squares(const MatX& A, const VecX& b, double threshold);

// Compute orthonormal columns that span the orthogonal complement of the columns of A. Pivots of A below `threshold` of
// the largest count as zero.
MatX orthogonal_complement(const MatX& A, double threshold);

// Solve S X = B for a symmetric positive semidefinite S, by L D L^T with pivoting.
MatX solve_semidefinite(const MatX& S, const MatX& B);

// Eigenvalues in ascending order and unit eigenvectors (columns) of a symmetric matrix.
struct Spectrum {
    VecX values;
    MatX vectors;
};
Spectrum symmetric_spectrum(const MatX& S);

}  // namespace pn
