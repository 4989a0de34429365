// Factorizations of dense matrices by Eigen, instantiated in one source: their templates take seconds to compile
// wherever they are named.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "math/spatial.hpp"

namespace pn {

// A = L L^T of a symmetric positive definite matrix.
class Cholesky {
public:
    // False where A is not positive definite to rounding; L is then undefined.
    bool compute(const MatX& A);
    // Lower triangle of L; above the diagonal stands what A had.
    const MatX& factor() const { return factor_.matrixLLT(); }
    // x of A x = b; allocates nothing where x has the size.
    void solve(const VecX& b, VecX& x) const;
    // X of L X = B.
    MatX solve_lower(const MatX& B) const;

private:
    Eigen::LLT<MatX> factor_;
};

// P A = L U of a square matrix, with partial pivoting. A singular A gives infinite numbers, not an error.
class LU {
public:
    void compute(const MatX& A);
    double determinant() const;
    // Estimate of 1 / (|A| |A^-1|) in the 1-norm.
    double reciprocal_condition() const;
    // x of A x = b; allocates nothing where x has the size.
    void solve(const VecX& b, VecX& x) const;

private:
    Eigen::PartialPivLU<MatX> factor_;
};

// x of A x = b, |A|, and A^-1, by LU.
VecX solve(const MatX& A, const VecX& b);
double determinant(const MatX& A);
MatX inverse(const MatX& A);

// Shortest x among those with the least |A x - b|. Pivots below `threshold` of the largest count as zero.
VecX least_squares(const MatX& A, const VecX& b, double threshold);

// An x with the least |A x - b|, zero in columns that others span.
VecX basic_least_squares(const MatX& A, const VecX& b);

// Orthonormal columns that span what is orthogonal to the columns of A, of which pivots below `threshold` of the largest
// count as zero.
MatX orthogonal_complement(const MatX& A, double threshold);

// x of S x = b for a symmetric positive semidefinite S, by L D L^T with pivoting.
VecX solve_semidefinite(const MatX& S, const VecX& b);

// Eigenvalues in ascending order and unit eigenvectors (columns) of a symmetric matrix.
struct Spectrum {
    VecX values;
    MatX vectors;
};
Spectrum symmetric_spectrum(const MatX& S);

}  // namespace pn
