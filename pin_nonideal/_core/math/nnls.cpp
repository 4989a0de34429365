#include "math/nnls.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/decompositions.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

// Least-squares solutions over a set of columns, which changes by one column at a time. [Lawson, Hanson, ch. 24.]
class ColumnSet {
public:
    ColumnSet(Eigen::Index rows, Eigen::Index max_columns)
        : Q_(rows, std::min(rows, max_columns)), R_(MatX::Zero(Q_.cols(), Q_.cols())) {}

    // Append a column. Return false if the set spans it.
    bool append(const VecX& column) {
        const double length = column.norm();
        VecX rest = column;
        if (count_ == Q_.cols()) return false;
        R_.col(count_).setZero();
        for (int pass = 0; pass < nnls_parameters.orthogonal_passes; ++pass) {
            const VecX part = Q_.leftCols(count_).transpose() * rest;
            rest.noalias() -= Q_.leftCols(count_) * part;
            R_.col(count_).head(count_) += part;
        }
        const double pivot = rest.norm();
        if (!(pivot > nnls_parameters.min_column_pivot * length)) return false;
        R_(count_, count_) = pivot;
        Q_.col(count_++) = rest / pivot;
        return true;
    }

    void remove(Eigen::Index column) {
        --count_;
        for (Eigen::Index k = column; k < count_; ++k) {
            R_.col(k) = R_.col(k + 1);
            const double size = std::hypot(R_(k, k), R_(k + 1, k)), c = R_(k, k) / size, s = R_(k + 1, k) / size;
            for (Eigen::Index l = k + 2; l <= count_; ++l) rotate(R_(k, l), R_(k + 1, l), c, s);
            R_(k, k) = size;
            R_(k + 1, k) = 0.0;
            for (Eigen::Index row = 0; row < Q_.rows(); ++row) rotate(Q_(row, k), Q_(row, k + 1), c, s);
        }
    }

    VecX solve(const VecX& b) const {
        VecX x = Q_.leftCols(count_).transpose() * b;
        R_.topLeftCorner(count_, count_).triangularView<Eigen::Upper>().solveInPlace(x);
        return x;
    }

private:
    static void rotate(double& x, double& y, double c, double s) {
        const double turned = c * x + s * y;
        y = c * y - s * x;
        x = turned;
    }

    MatX Q_, R_;  // orthonormal columns, and the upper triangle that gives the columns of the set
    Eigen::Index count_ = 0;
};

double largest(const VecX& x) { return x.size() > 0 ? x.cwiseAbs().maxCoeff() : 0.0; }

// Return the projector onto the orthogonal complement of the columns of Z.
MatX complement_of(const MatX& Z) {
    const Eigen::Index n = Z.rows();
    if (Z.cols() == 0) return MatX::Identity(n, n);
    const MatX Q = orthogonal_complement(Z, nnls_parameters.min_column_pivot);
    return Q * Q.transpose();
}

}  // namespace

VecX nonnegative_least_squares(const MatX& A, const VecX& b) {
    const int n = static_cast<int>(A.cols());
    const VecX lengths = A.colwise().norm();
    const double size = n > 0 ? A.cwiseAbs().maxCoeff() : 0.0, size_of_b = b.norm();
    VecX x = VecX::Zero(n);
    std::vector<int> used;
    std::vector<char> is_rejected(n, 0), is_used(n, 0);
    ColumnSet columns(A.rows(), n);
    for (int pass = 0; pass < nnls_parameters.exchanges * n; ++pass) {
        const VecX residual = b - A * x, descent = A.transpose() * residual;
        const double rounding = nnls_parameters.rounding * (size_of_b + size * largest(x));
        int best = -1;
        double steepest = 0.0;
        for (int j = 0; j < n; ++j) {
            if (is_rejected[j] || is_used[j] || !(descent[j] > rounding * lengths[j])) continue;
            if (descent[j] > steepest * lengths[j]) { steepest = descent[j] / lengths[j]; best = j; }
        }
        if (best < 0) break;
        is_rejected[best] = 1;  // unless its number is positive, also in rounding
        if (!columns.append(A.col(best))) continue;
        used.push_back(best);
        VecX s = columns.solve(b);
        if (!(s[s.size() - 1] > 0.0)) {
            used.pop_back();
            columns.remove(static_cast<Eigen::Index>(used.size()));
            continue;
        }
        while (s.size() > 0 && s.minCoeff() <= 0.0) {  // step only as far as all stay nonnegative
            double part = 1.0;
            for (size_t k = 0; k < used.size(); ++k)
                if (s[k] <= 0.0) part = std::min(part, x[used[k]] > 0.0 ? x[used[k]] / (x[used[k]] - s[k]) : 0.0);
            for (size_t k = 0; k < used.size(); ++k) x[used[k]] += part * (s[k] - x[used[k]]);
            const double min_used = nnls_parameters.rounding * largest(x);
            for (size_t k = used.size(); k-- > 0;) {
                if (x[used[k]] > min_used) continue;
                x[used[k]] = 0.0;
                is_used[used[k]] = 0;
                used.erase(used.begin() + static_cast<std::ptrdiff_t>(k));
                columns.remove(static_cast<Eigen::Index>(k));
            }
            s = columns.solve(b);
        }
        for (size_t k = 0; k < used.size(); ++k) {
            x[used[k]] = s[k];
            is_used[used[k]] = 1;
        }
        std::fill(is_rejected.begin(), is_rejected.end(), char(0));
    }
    return x;
}

VecX min_violation(const MatX& Z, const VecX& N) {
    if (N.size() == 0 || N.minCoeff() >= 0.0) return VecX::Zero(N.size());
    const MatX P = complement_of(Z);
    const VecX off = P * (N - nonnegative_least_squares(P, P * N));  // the rest of N lies in the range of Z
    const double noise = nnls_parameters.rounding * static_cast<double>(N.size()) * largest(N);
    return off.unaryExpr([noise](double x) { return x < -noise ? -x : 0.0; });
}

VecX shortest_with_zeros(const MatX& Z, const VecX& N, const std::vector<char>& zero) {
    const int count = static_cast<int>(std::count(zero.begin(), zero.end(), char(1)));
    if (count == 0 || Z.cols() == 0) return VecX::Zero(Z.cols());
    MatX rows(count, Z.cols());
    VecX numbers(count);
    for (int i = 0, k = 0; i < N.size(); ++i)
        if (zero[i]) { rows.row(k) = Z.row(i); numbers[k++] = N[i]; }
    return -least_squares(rows, numbers, nnls_parameters.min_column_pivot);
}

// Return the numbers that bind in the shortest z with N + Z z >= 0. These are the positive entries of u >= 0 for which
// [Z^T; -N^T] u is nearest to the last unit vector. [Lawson, Hanson, 23.4.]
static std::vector<char> binding(const MatX& Z, const VecX& N) {
    MatX both(Z.cols() + 1, Z.rows());
    both << Z.transpose(), -N.transpose() / std::max(largest(N), min_scale);
    const VecX u = nonnegative_least_squares(both, VecX::Unit(both.rows(), both.rows() - 1));
    std::vector<char> is_binding(N.size());
    for (int i = 0; i < N.size(); ++i) is_binding[i] = u[i] > 0.0;
    return is_binding;
}

NonnegativeSum shortest_nonnegative(const MatX& Z, const VecX& N) {
    NonnegativeSum sum{VecX::Zero(Z.cols()), std::vector<char>(N.size(), 0), true};
    const auto violated = [&](double allowed) { return (N + Z * sum.z).minCoeff() < -allowed; };
    const auto noise = [&] { return nnls_parameters.met_rounding * (largest(N) + largest(sum.z)); };
    if (N.size() == 0 || !violated(0.0)) return sum;
    sum.held = binding(Z, N);
    sum.z = shortest_with_zeros(Z, N, sum.held);
    sum.is_feasible = !violated(noise());
    if (sum.is_feasible) return sum;
    const VecX violation = min_violation(Z, N);
    sum.held = binding(Z, N + violation + VecX::Constant(N.size(), nnls_parameters.binding_slack * largest(N)));
    for (int i = 0; i < N.size(); ++i)
        if (violation[i] > 0.0) sum.held[i] = 1;
    sum.z = shortest_with_zeros(Z, N, sum.held);
    return sum;
}

MaxMin max_min(const MatX& Z, const VecX& N) {
    const double size = largest(N);
    double value = N.maxCoeff() + std::max(size, min_scale);  // above any weighted mean of N
    MaxMin found{size, VecX()};
    for (int cut = 0; cut < nnls_parameters.max_cuts; ++cut) {
        const VecX violation = min_violation(Z, (N.array() - value).matrix());
        if (largest(violation) <= nnls_parameters.met_rounding * size) break;  // smaller violations are rounding error
        found.weight = violation / violation.sum();
        const double bound = found.weight.dot(N);
        if (!(bound < value - nnls_parameters.rounding * size)) { value = bound; break; }
        value = bound;
    }
    if (found.weight.size() > 0) found.value = value;
    return found;
}

}  // namespace pn
