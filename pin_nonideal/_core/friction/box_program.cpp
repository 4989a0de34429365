#include "friction/box_program.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/QR>

namespace pn {

namespace {

constexpr double met = 1e-9;  // part of the accelerations in play that counts as none
constexpr double at_limit = 1e-12;  // part of it within which a force is
// Least root of a pivot of W, scaled to a unit diagonal, with which Cholesky's factor is as good as an orthogonal one.
constexpr double regular_pivot = 1e-3;

// x of W x = r where W, scaled to a unit diagonal, keeps clear of singular; returns whether it does.
bool solve_regular(const MatX& W, const VecX& r, VecX& x) {
    const VecX scale = W.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::LLT<MatX> factor(scale.asDiagonal() * W * scale.asDiagonal());
    if (factor.info() != Eigen::Success || !(factor.matrixLLT().diagonal().minCoeff() > regular_pivot)) return false;
    x.setZero();
    for (int pass = 0; pass < 2; ++pass)  // the second gives back the digits that the condition costs
        x += scale.cwiseProduct(factor.solve(scale.cwiseProduct(r - W * x)));
    return true;
}

// Least-norm x of W_FF x = r_F on the free elements F; zero on the others, and where nothing responds.
VecX solve_free(const MatX& W, const VecX& r, const std::vector<char>& is_free) {
    std::vector<int> list;
    for (int i = 0; i < r.size(); ++i)
        if (is_free[i] && W(i, i) > 0.0) list.push_back(i);
    const int n = static_cast<int>(list.size());
    VecX x = VecX::Zero(r.size());
    if (n == 0) return x;
    MatX WF(n, n);
    VecX rF(n), xF(n);
    for (int i = 0; i < n; ++i) {
        rF[i] = r[list[i]];
        for (int j = 0; j < n; ++j) WF(i, j) = W(list[i], list[j]);
    }
    if (!solve_regular(WF, rF, xF)) {
        Eigen::CompleteOrthogonalDecomposition<MatX> cod(n, n);
        cod.setThreshold(rank_threshold);
        cod.compute(WF);
        xF = cod.solve(rF);
    }
    for (int i = 0; i < n; ++i) x[list[i]] = xF[i];
    return x;
}

double size_of(const MatX& W, const VecX& alpha0, const VecX& f) {
    return alpha0.cwiseAbs().maxCoeff() + (W * f.cwiseAbs()).cwiseAbs().maxCoeff();
}

// Forces that the limits allow, those near by: each at its limit or free.
VecX start(const VecX& s, const VecX* near, std::vector<char>& is_free) {
    const int n = static_cast<int>(s.size());
    VecX f = VecX::Zero(n);
    for (int i = 0; i < n; ++i) {
        is_free[i] = s[i] > 0.0 && (!near || std::abs((*near)[i]) < s[i] * (1.0 - at_limit));
        if (near && s[i] > 0.0) f[i] = is_free[i] ? (*near)[i] : (*near)[i] > 0.0 ? s[i] : -s[i];
    }
    return f;
}

// Primal active set: from forces near by, or none, steps that lower f^T W f / 2 + alpha0^T f and stay in the box. Where
// redundant elements cannot all stick, since what they would have to hold back is no acceleration that forces cause, the
// program falls without end along a direction with W d = 0, until one of them is at its limit and slips.
VecX active_set(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* near) {
    const int n = static_cast<int>(s.size());
    std::vector<char> is_free(n);
    VecX f = start(s, near, is_free);
    const double size = size_of(W, alpha0, s);
    for (int it = 0; it < 20 * (n + 1) * (n + 1); ++it) {
        const VecX alpha = alpha0 + W * f;
        VecX step = solve_free(W, -alpha, is_free), left = alpha + W * step;
        for (int i = 0; i < n; ++i)
            if (!is_free[i]) left[i] = 0.0;
        const bool endless = left.cwiseAbs().maxCoeff() > met * size;
        if (endless) step = -left;
        double length = endless ? HUGE_VAL : 1.0;
        int hit = -1;
        for (int i = 0; i < n; ++i) {
            if (step[i] == 0.0) continue;
            const double room = ((step[i] > 0.0 ? s[i] : -s[i]) - f[i]) / step[i];
            if (room < length) { length = room; hit = i; }
        }
        f += length * step;
        if (hit >= 0) {
            f[hit] = step[hit] > 0.0 ? s[hit] : -s[hit];
            is_free[hit] = 0;
            continue;
        }
        const VecX now = alpha0 + W * f;
        int worst = -1;  // what slips against its force no longer does
        double most = 1e-13 * size;
        for (int i = 0; i < n; ++i)
            if (!is_free[i] && s[i] > 0.0 && now[i] * (f[i] > 0.0 ? 1.0 : -1.0) > most) {
                most = std::abs(now[i]);
                worst = i;
            }
        if (worst < 0) return f;
        is_free[worst] = 1;
    }
    return f;
}

}  // namespace

VecX least_norm_solution(const MatX& W, const VecX& r) {
    return solve_free(W, r, std::vector<char>(r.size(), 1));
}

// Block principal pivoting, single (least index) once it fails to make progress.
VecX box_program(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* near) {
    const int n = static_cast<int>(s.size());
    VecX f = VecX::Zero(n);
    std::vector<char> is_free(n, 1);
    for (int i = 0; near && i < n; ++i) {
        is_free[i] = std::abs((*near)[i]) < s[i] * (1.0 - at_limit);
        if (!is_free[i]) f[i] = (*near)[i] > 0.0 ? s[i] : -s[i];
    }
    int fewest = n + 1, patience = 10;
    for (int it = 0; it < 200 + 50 * n; ++it) {
        for (int i = 0; i < n; ++i)
            if (is_free[i]) f[i] = 0.0;
        f += solve_free(W, -(alpha0 + W * f), is_free);
        const VecX alpha = alpha0 + W * f;
        const double size = size_of(W, alpha0, f);
        std::vector<int> wrong;
        for (int i = 0; i < n; ++i) {
            if (is_free[i] && std::abs(alpha[i]) > met * size) return active_set(W, alpha0, s, near);
            const bool outside = is_free[i] && std::abs(f[i]) > s[i] * (1.0 + 1e-13);
            const bool drives = !is_free[i] && alpha[i] * f[i] > 1e-13 * size * std::abs(f[i]);
            if (outside || drives) wrong.push_back(i);
        }
        if (wrong.empty()) return f;
        if (static_cast<int>(wrong.size()) < fewest) {
            fewest = static_cast<int>(wrong.size());
            patience = 10;
        } else if (--patience < 0) {
            wrong.assign(1, wrong.back());
        }
        for (int i : wrong) {
            if (is_free[i]) f[i] = f[i] > 0.0 ? s[i] : -s[i];
            is_free[i] = !is_free[i];
        }
    }
    return active_set(W, alpha0, s, near);
}

}  // namespace pn
