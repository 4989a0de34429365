#include "math/nnls.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "math/decompositions.hpp"

namespace pn {

namespace {

// What a handful of products leaves of numbers that cancel, as a part of them.
constexpr double rounding = 1e-13;
// Columns that the others leave less of than this part are spanned by them.
constexpr double spanned = 1e-11;
// Violation that is left for the search of what binds, where no z meets all: it must not be lost in rounding.
constexpr double slack = 1e-9;
// What is left of zero by a least-squares solution, as a part of the numbers that it adds.
constexpr double met_rounding = 1e-11;
// Exchanges for each column after which the rest is rounding; the method is finite, and takes about one.
constexpr int exchanges = 10;
constexpr double least_size = 1e-300;  // of numbers that are all zero
constexpr int most_cuts = 50;  // of the bound on the largest least number, each exact for the numbers that bind

// Least squares over some of the columns.
VecX solve_over(const MatX& A, const VecX& b, const std::vector<int>& columns) {
    MatX part(A.rows(), static_cast<Eigen::Index>(columns.size()));
    for (size_t k = 0; k < columns.size(); ++k) part.col(k) = A.col(columns[k]);
    return basic_least_squares(part, b);
}

double largest(const VecX& x) { return x.size() > 0 ? x.cwiseAbs().maxCoeff() : 0.0; }

// What is orthogonal to the columns of Z, as a matrix.
MatX complement_of(const MatX& Z) {
    const Eigen::Index n = Z.rows();
    if (Z.cols() == 0) return MatX::Identity(n, n);
    const MatX Q = orthogonal_complement(Z, spanned);
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
            if (!(descent[j] > rounding * length * (b.norm() + A.cwiseAbs().maxCoeff() * largest(x)))) continue;
            if (descent[j] > steepest * length) { steepest = descent[j] / length; best = j; }
        }
        if (best < 0) break;
        used.push_back(best);
        VecX s = solve_over(A, b, used);
        if (!(s[s.size() - 1] > 0.0)) {  // rounding says that it would fall
            refused[best] = 1;
            used.pop_back();
            continue;
        }
        while (s.size() > 0 && s.minCoeff() <= 0.0) {  // as far as all stay positive
            double part = 1.0;
            for (size_t k = 0; k < used.size(); ++k)
                if (s[k] <= 0.0) part = std::min(part, x[used[k]] > 0.0 ? x[used[k]] / (x[used[k]] - s[k]) : 0.0);
            for (size_t k = 0; k < used.size(); ++k) x[used[k]] += part * (s[k] - x[used[k]]);
            const auto stays = [&](int j) { return x[j] > rounding * largest(x); };
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
    const VecX off = P * (N - nonnegative_least_squares(P, P * N));  // z takes up the rest
    const double noise = rounding * static_cast<double>(N.size()) * largest(N);
    return off.unaryExpr([noise](double x) { return x < -noise ? -x : 0.0; });
}

VecX shortest_with_zeros(const MatX& Z, const VecX& N, const std::vector<char>& zero) {
    const int count = static_cast<int>(std::count(zero.begin(), zero.end(), char(1)));
    if (count == 0 || Z.cols() == 0) return VecX::Zero(Z.cols());
    MatX rows(count, Z.cols());
    VecX numbers(count);
    for (int i = 0, k = 0; i < N.size(); ++i)
        if (zero[i]) { rows.row(k) = Z.row(i); numbers[k++] = N[i]; }
    return -least_squares(rows, numbers, spanned);
}

// Which numbers bind in the shortest z with N + Z z >= 0, as weights, none where that has no solution: with
// u >= 0 the nearest that [Z^T; -N^T] u comes to the last unit vector. [Lawson, Hanson, 23.4.]
static std::vector<char> binding(const MatX& Z, const VecX& N) {
    MatX both(Z.cols() + 1, Z.rows());
    both << Z.transpose(), -N.transpose() / std::max(largest(N), least_size);
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
    found.held = binding(Z, N + violation + VecX::Constant(N.size(), slack * largest(N)));
    for (int i = 0; i < N.size(); ++i)
        if (violation[i] > 0.0) found.held[i] = 1;
    found.z = shortest_with_zeros(Z, N, found.held);
    return found;
}

LargestLeast largest_least(const MatX& Z, const VecX& N) {
    const double size = largest(N);
    double value = N.maxCoeff() + std::max(size, least_size);  // above what any weights of sum 1 can give
    LargestLeast found{size, VecX()};
    for (int cut = 0; cut < most_cuts; ++cut) {
        const VecX violation = least_violation(Z, (N.array() - value).matrix());
        if (largest(violation) <= met_rounding * size) break;  // its parts would be rounding
        found.weight = violation / violation.sum();
        const double bound = found.weight.dot(N);
        if (!(bound < value - rounding * size)) { value = bound; break; }
        value = bound;
    }
    if (found.weight.size() > 0) found.value = value;
    return found;
}

}  // namespace pn
