#include "math/decompositions.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>

namespace pn {

bool Cholesky::compute(const MatX& A) {
    factor_.compute(A);
    return factor_.info() == Eigen::Success;
}

void Cholesky::solve(const VecX& b, VecX& x) const { x = factor_.solve(b); }

MatX Cholesky::solve_lower(const MatX& B) const { return factor_.matrixL().solve(B); }

void LU::compute(const MatX& A) { factor_.compute(A); }

double LU::determinant() const { return factor_.determinant(); }

double LU::reciprocal_condition() const { return factor_.rcond(); }

void LU::solve(const VecX& b, VecX& x) const { x = factor_.solve(b); }

VecX solve(const MatX& A, const VecX& b) { return A.partialPivLu().solve(b); }

double determinant(const MatX& A) { return A.determinant(); }

MatX inverse(const MatX& A) { return A.inverse(); }

VecX least_squares(const MatX& A, const VecX& b, double threshold) {
    Eigen::CompleteOrthogonalDecomposition<MatX> factor(A.rows(), A.cols());
    factor.setThreshold(threshold);
    factor.compute(A);
    return factor.solve(b);
}

MatX orthogonal_complement(const MatX& A, double threshold) {
    const Eigen::Index n = A.rows();
    Eigen::ColPivHouseholderQR<MatX> factor(A);
    factor.setThreshold(threshold);
    return MatX(factor.householderQ() * MatX::Identity(n, n)).rightCols(n - factor.rank());
}

MatX solve_semidefinite(const MatX& S, const MatX& B) { return S.ldlt().solve(B); }

Spectrum symmetric_spectrum(const MatX& S) {
    const Eigen::SelfAdjointEigenSolver<MatX> eigen(S);
    return {eigen.eigenvalues(), eigen.eigenvectors()};
}

}  // namespace pn
