#include "complementarity/small_dense.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace pn {

namespace {

// Pivot of the elimination, as a fraction of the largest entry, below which a full rank is uncertain.
constexpr double min_elimination_pivot = 1e-9;

// Compute the reflector that maps x = (x0, rest) to (beta, 0): I - tau (1, u)(1, u)^T, with u in place of rest. Returns tau.
template <class Rest>
double reflector(double& x0, Rest&& rest) {
    const double beside = rest.squaredNorm();
    if (beside == 0.0) return 0.0;
    const double norm = std::sqrt(x0 * x0 + beside), beta = x0 > 0.0 ? -norm : norm;
    const double tau = (beta - x0) / beta;
    rest *= 1.0 / (x0 - beta);
    x0 = beta;
    return tau;
}

}  // namespace

void DenseSolver::factor(const Eigen::Ref<const MatX>& A) {
    regular_ = eliminate(A);
    if (!regular_) factor_orthogonally(A);
}

bool DenseSolver::eliminate(const Eigen::Ref<const MatX>& A) {
    n_ = rank_ = static_cast<int>(A.rows());
    auto L = factors_.matrix(n_, n_);
    L = A;
    order_.resize(std::max<size_t>(order_.size(), n_));
    const double min_pivot = min_elimination_pivot * (n_ > 0 ? A.cwiseAbs().maxCoeff() : 0.0);
    for (int k = 0; k < n_; ++k) {
        int pivot = 0;
        const double size = L.col(k).tail(n_ - k).cwiseAbs().maxCoeff(&pivot);
        if (!(size > min_pivot)) return false;
        order_[k] = pivot += k;
        if (pivot != k) L.row(k).swap(L.row(pivot));
        const int below = n_ - k - 1;
        L.col(k).tail(below) *= 1.0 / L(k, k);
        for (int j = k + 1; j < n_; ++j) L.col(j).tail(below) -= L(k, j) * L.col(k).tail(below);
    }
    return true;
}

int DenseSolver::orientation() const {
    if (!regular_) return 0;
    const auto L = factors_.matrix(n_, n_);
    bool negative = false;
    for (int k = 0; k < n_; ++k) negative ^= (order_[k] != k) ^ (L(k, k) < 0.0);
    return negative ? -1 : 1;
}

void DenseSolver::factor_orthogonally(const Eigen::Ref<const MatX>& A, double tolerance) {
    regular_ = false;
    n_ = static_cast<int>(A.rows());
    auto F = factors_.matrix(n_, n_);
    auto tau = tau_.vector(n_), tau_right = tau_right_.vector(n_);
    F = A;
    order_.resize(std::max<size_t>(order_.size(), n_));
    std::iota(order_.begin(), order_.begin() + n_, 0);
    double largest = 0.0;
    for (rank_ = 0; rank_ < n_; ++rank_) {
        const int k = rank_, below = n_ - k - 1;
        int best = k;
        double length = -1.0;
        for (int c = k; c < n_; ++c) {
            const double here = F.col(c).tail(n_ - k).squaredNorm();
            if (here > length) { length = here; best = c; }
        }
        length = std::sqrt(length);
        largest = std::max(largest, length);
        if (!(length > tolerance * largest)) break;
        if (best != k) {
            F.col(k).swap(F.col(best));
            std::swap(order_[k], order_[best]);
        }
        tau[k] = reflector(F(k, k), F.col(k).tail(below));
        for (int c = k + 1; c < n_; ++c) reflect(k, F.col(c));
    }
    const int beyond = n_ - rank_;
    for (int k = rank_ - 1; k >= 0 && beyond > 0; --k) {  // reflect the dependent columns into the others
        tau_right[k] = reflector(F(k, k), F.row(k).tail(beyond));
        for (int i = 0; i < k; ++i) {
            const double w = tau_right[k] * (F(i, k) + F.row(i).tail(beyond).dot(F.row(k).tail(beyond)));
            F(i, k) -= w;
            F.row(i).tail(beyond) -= w * F.row(k).tail(beyond);
        }
    }
}

// Apply the k-th left reflector to x.
void DenseSolver::reflect(int k, Eigen::Ref<VecX> x) const {
    const Eigen::Map<const MatX> F = factors_.matrix(n_, n_);
    const int below = n_ - k - 1;
    const double w = tau_.vector(n_)[k] * (x[k] + F.col(k).tail(below).dot(x.tail(below)));
    x[k] -= w;
    x.tail(below) -= w * F.col(k).tail(below);
}

void DenseSolver::substitute(Eigen::Ref<VecX> x) {
    const auto L = factors_.matrix(n_, n_);
    for (int k = 0; k < n_; ++k) std::swap(x[k], x[order_[k]]);
    for (int k = 0; k < n_; ++k) x.tail(n_ - k - 1) -= x[k] * L.col(k).tail(n_ - k - 1);
    for (int k = n_ - 1; k >= 0; --k) {
        x[k] /= L(k, k);
        x.head(k) -= x[k] * L.col(k).head(k);
    }
}

void DenseSolver::solve(const Eigen::Ref<const VecX>& r, Eigen::Ref<VecX> x) {
    if (regular_) {
        x = r;
        substitute(x);
        return;
    }
    const auto F = factors_.matrix(n_, n_);
    auto y = work_.vector(n_);
    y = r;
    for (int k = 0; k < rank_; ++k) reflect(k, y);
    const int beyond = n_ - rank_;
    y.tail(beyond).setZero();
    for (int k = rank_ - 1; k >= 0; --k) {
        y[k] /= F(k, k);
        y.head(k) -= y[k] * F.col(k).head(k);
    }
    for (int k = 0; k < rank_ && beyond > 0; ++k) {
        const double w = tau_right_.vector(n_)[k] * (y[k] + F.row(k).tail(beyond).dot(y.tail(beyond)));
        y[k] -= w;
        y.tail(beyond) -= w * F.row(k).tail(beyond).transpose();
    }
    for (int k = 0; k < n_; ++k) x[order_[k]] = y[k];
}

void DenseSolver::range(Eigen::Ref<MatX> basis) const {
    for (int c = 0; c < rank_; ++c) {
        basis.col(c).setZero();
        basis(c, c) = 1.0;
        for (int k = std::min(rank_, n_) - 1; k >= 0; --k) reflect(k, basis.col(c));
    }
}

}  // namespace pn
