#include "math/nnls.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/decompositions.hpp"

namespace pn {

namespace {

// Rounding of a few products, relative to the numbers that cancel.
constexpr double nnls_rounding = 1e-13;
// Relative pivot below which a column counts as spanned by the others.
constexpr double min_column_pivot = 1e-11;
// Slack for the search of binding numbers if no z is feasible, relative to max |N|. It must exceed rounding.
constexpr double binding_slack = 1e-9;
// Rounding of a zero in a least-squares solution, relative to the numbers that it sums.
constexpr double met_rounding = 1e-11;
// Maximum number of exchanges per column. The method is finite and takes about one. Further exchanges are rounding.
constexpr int exchanges = 10;
constexpr int most_cuts = 50;  // updates of the bound in largest_least, each exact for the binding numbers

// Solve the least-squares problem over the listed columns.
VecX solve_over(const MatX& A, const VecX& b, const std::vector<int>& columns) {
    MatX part(A.rows(), static_cast<Eigen::Index>(columns.size()));
    for (size_t k = 0; k < columns.size(); ++k) part.col(k) = A.col(columns[k]);
    return basic_least_squares(part, b);
}

double largest(const VecX& x) { return x.size() > 0 ? x.cwiseAbs().maxCoeff() : 0.0; }

// Return the projector onto the orthogonal complement of the columns of Z.
MatX complement_of(const MatX& Z) {
    const Eigen::Index n = Z.rows();
    if (Z.cols() == 0) return MatX::Identity(n, n);
    const MatX Q = orthogonal_complement(Z, min_column_pivot);
    return Q * Q.transpose();
}

}  // namespace

VecX nonnegative_least_squares(const MatX& A, const VecX& b) {
    const int n = static_cast<int>(A.cols());
    VecX x = VecX::Zero(n);
    std::vector<int> used;
    std::vector<char> refused(n, 0);
    for (int pass = 0; pass < exchanges * n; ++pass) {
        const VecX residual = b - A * x, descent = A.transpose() * residual;
        int best = -1;
        double steepest = 0.0;
        for (int j = 0; j < n; ++j) {
            if (refused[j] || std::find(used.begin(), used.end(), j) != used.end()) continue;
            const double length = A.col(j).norm();
            if (!(descent[j] > nnls_rounding * length * (b.norm() + A.cwiseAbs().maxCoeff() * largest(x)))) continue;
            if (descent[j] > steepest * length) { steepest = descent[j] / length; best = j; }
        }
        if (best < 0) break;
        used.push_back(best);
        VecX s = solve_over(A, b, used);
        if (!(s[s.size() - 1] > 0.0)) {  // positive but for rounding
            refused[best] = 1;
            used.pop_back();
            continue;
        }
        while (s.size() > 0 && s.minCoeff() <= 0.0) {  // step only as far as all stay nonnegative
            double part = 1.0;
            for (size_t k = 0; k < used.size(); ++k)
                if (s[k] <= 0.0) part = std::min(part, x[used[k]] > 0.0 ? x[used[k]] / (x[used[k]] - s[k]) : 0.0);
            for (size_t k = 0; k < used.size(); ++k) x[used[k]] += part * (s[k] - x[used[k]]);
            const auto stays = [&](int j) { return x[j] > nnls_rounding * largest(x); };
            for (int j : used)
                if (!stays(j)) x[j] = 0.0;
            used.erase(std::stable_partition(used.begin(), used.end(), stays), used.end());
            s = solve_over(A, b, used);
        }
        for (size_t k = 0; k < used.size(); ++k) x[used[k]] = s[k];
        std::fill(refused.begin(), refused.end(), char(0));
    }
    return x;
}

VecX least_violation(const MatX& Z, const VecX& N) {
    if (N.size() == 0 || N.minCoeff() >= 0.0) return VecX::Zero(N.size());
    const MatX P = complement_of(Z);
    const VecX off = P * (N - nonnegative_least_squares(P, P * N));  // Z z takes up the rest
    const double noise = nnls_rounding * static_cast<double>(N.size()) * largest(N);
    return off.unaryExpr([noise](double x) { return x < -noise ? -x : 0.0; });
}

VecX shortest_with_zeros(const MatX& Z, const VecX& N, const std::vector<char>& zero) {
    const int count = static_cast<int>(std::count(zero.begin(), zero.end(), char(1)));
    if (count == 0 || Z.cols() == 0) return VecX::Zero(Z.cols());
    MatX rows(count, Z.cols());
    VecX numbers(count);
    for (int i = 0, k = 0; i < N.size(); ++i)
        if (zero[i]) { rows.row(k) = Z.row(i); numbers[k++] = N[i]; }
    return -least_squares(rows, numbers, min_column_pivot);
}

// Return the numbers that bind in the shortest z with N + Z z >= 0. These are the positive entries of u >= 0 for which
// [Z^T; -N^T] u is nearest to the last unit vector. [Lawson, Hanson, 23.4.]
static std::vector<char> binding(const MatX& Z, const VecX& N) {
    MatX both(Z.cols() + 1, Z.rows());
    both << Z.transpose(), -N.transpose() / std::max(largest(N), min_scale);
    const VecX u = nonnegative_least_squares(both, VecX::Unit(both.rows(), both.rows() - 1));
    std::vector<char> found(N.size());
    for (int i = 0; i < N.size(); ++i) found[i] = u[i] > 0.0;
    return found;
}

Nonnegative shortest_nonnegative(const MatX& Z, const VecX& N) {
    Nonnegative found{VecX::Zero(Z.cols()), std::vector<char>(N.size(), 0), true};
    const auto violated = [&](double allowed) { return (N + Z * found.z).minCoeff() < -allowed; };
    const auto noise = [&] { return met_rounding * (largest(N) + largest(found.z)); };
    if (N.size() == 0 || !violated(0.0)) return found;
    found.held = binding(Z, N);
    found.z = shortest_with_zeros(Z, N, found.held);
    found.met = !violated(noise());
    if (found.met) return found;
    const VecX violation = least_violation(Z, N);
    found.held = binding(Z, N + violation + VecX::Constant(N.size(), binding_slack * largest(N)));
    for (int i = 0; i < N.size(); ++i)
        if (violation[i] > 0.0) found.held[i] = 1;
    found.z = shortest_with_zeros(Z, N, found.held);
    return found;
}

LargestLeast largest_least(const MatX& Z, const VecX& N) {
    const double size = largest(N);
    double value = N.maxCoeff() + std::max(size, min_scale);  // above any weighted mean of N
    LargestLeast found{size, VecX()};
    for (int cut = 0; cut < most_cuts; ++cut) {
        const VecX violation = least_violation(Z, (N.array() - value).matrix());
        if (largest(violation) <= met_rounding * size) break;  // smaller violations are rounding
        found.weight = violation / violation.sum();
        const double bound = found.weight.dot(N);
        if (!(bound < value - nnls_rounding * size)) { value = bound; break; }
        value = bound;
    }
    if (found.weight.size() > 0) found.value = value;
    return found;
}

}  // namespace pn
