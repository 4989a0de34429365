// Square systems A x = r of any rank, in buffers that grow to the largest size asked for and stay.
#pragma once

#include <vector>

#include "math/spatial.hpp"

namespace pn {

// Numbers that are seen as a matrix or a vector of whatever size is at hand.
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

    // By elimination, and where its pivots fall below `regular_pivot` of their rows by orthogonal factors, with the
    // rank by `rank_tolerance`.
    void factor(const Eigen::Ref<const MatX>& A);
    // Orthogonal factors whatever the pivots; columns of which they leave no more than this part of the largest are none.
    void factor_orthogonally(const Eigen::Ref<const MatX>& A, double tolerance = rank_tolerance);
    bool regular() const { return regular_; }
    int rank() const { return rank_; }
    // x of least norm with A x = r, or the nearest to it where none is. x may be r.
    void solve(const Eigen::Ref<const VecX>& r, Eigen::Ref<VecX> x);
    // Orthonormal columns that span the columns of A, (n, rank), after factor_orthogonally.
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
