// Square systems A x = r of any rank, in buffers that grow to the largest size used and stay.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

// Storage that is mapped as a matrix or a vector of any size.
class Buffer {
public:
    Eigen::Map<MatX> matrix(int rows, int columns) {
        grow(static_cast<size_t>(rows) * columns);
        return {numbers_.data(), rows, columns};
    }
    Eigen::Map<VecX> vector(int n) {
        grow(n);
        return {numbers_.data(), n};
    }
    Eigen::Map<const MatX> matrix(int rows, int columns) const { return {numbers_.data(), rows, columns}; }
    Eigen::Map<const VecX> vector(int n) const { return {numbers_.data(), n}; }

private:
    void grow(size_t n) {
        if (numbers_.size() < n) numbers_.resize(n);
    }
    std::vector<double> numbers_;
};

class DenseSolver {
public:
    static constexpr double rank_tolerance = 1e-12;

    // Factorize by elimination. If a pivot falls below `regular_pivot` of the largest entry, orthogonal factors replace
    // it, with the rank by `rank_tolerance`.
    void factor(const Eigen::Ref<const MatX>& A);
    // Compute orthogonal factors for any pivots. A column counts as zero if no more than `tolerance` of the largest is
    // left of it.
    void factor_orthogonally(const Eigen::Ref<const MatX>& A, double tolerance = rank_tolerance);
    bool regular() const { return regular_; }
    // Return the sign of det(A), or 0 if A is not regular.
    int orientation() const;
    int rank() const { return rank_; }
    // Compute the minimum-norm x with A x = r, or the x that is nearest to a solution if there is none. x may be r.
    void solve(const Eigen::Ref<const VecX>& r, Eigen::Ref<VecX> x);
    // Compute orthonormal columns that span the columns of A, (n, rank). Requires factor_orthogonally.
    void range(Eigen::Ref<MatX> basis) const;

private:
    bool eliminate(const Eigen::Ref<const MatX>& A);
    void substitute(Eigen::Ref<VecX> x);
    void reflect(int k, Eigen::Ref<VecX> x) const;

    int n_ = 0, rank_ = 0;
    bool regular_ = false;
    Buffer factors_, work_, tau_, tau_right_;
    std::vector<int> order_;
};

}  // namespace pn
