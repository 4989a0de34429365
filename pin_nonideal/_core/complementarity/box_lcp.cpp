#include "complementarity/box_lcp.hpp"

#include <algorithm>
#include <cmath>

#include "math/lanes.hpp"

namespace pn {

namespace {

// Compute the Cholesky factor of A, scaled to a unit diagonal, in row-major order, with the inverse pivots. Return false if
// A is nearly singular.
PN_WIDE bool factor_scaled(int n, const double* A, const double* scale, double* L, double* inverse) {
    for (int i = 0; i < n; ++i) {
        double* Li = L + i * n;
        for (int j = 0; j <= i; ++j) {
            const double* Lj = L + j * n;
            const double sum = A[i + j * n] * scale[i] * scale[j] - dot(Li, Lj, j);
            if (j < i) Li[j] = sum * inverse[j];
            else if (!(sum > BoxProgram::parameters.min_pivot * BoxProgram::parameters.min_pivot)) return false;
            else inverse[i] = 1.0 / std::sqrt(sum);
        }
    }
    return true;
}

PN_WIDE void substitute_scaled(int n, const double* L, const double* inverse, double* x) {
    for (int i = 0; i < n; ++i) x[i] = (x[i] - dot(L + i * n, x, i)) * inverse[i];
    for (int i = n - 1; i >= 0; --i) {
        x[i] *= inverse[i];
        for (int j = 0; j < i; ++j) x[j] -= L[i * n + j] * x[i];
    }
}

}  // namespace

// Solve W_FF x = r_F into part_. Return false if W_FF, scaled to a unit diagonal, is nearly singular.
bool BoxProgram::solve_regular(int n) {
    auto A = A_.matrix(n, n), L = L_.matrix(n, n);
    auto scale = scale_.vector(n), inverse = inverse_.vector(n), rhs = rhs_.vector(n), x = part_.vector(n),
         change = change_.vector(n);
    scale = A.diagonal().cwiseSqrt().cwiseInverse();
    if (!factor_scaled(n, A.data(), scale.data(), L.data(), inverse.data())) return false;
    x.setZero();
    for (int pass = 0; pass < 2; ++pass) {  // the second pass restores digits that a large condition number loses
        change = rhs;
        if (pass > 0) change.noalias() -= A * x;
        change.array() *= scale.array();
        substitute_scaled(n, L.data(), inverse.data(), change.data());
        x.array() += scale.array() * change.array();
    }
    return true;
}

// Compute the minimum-norm x of W_FF x = r_F on the free elements F. Other elements, and elements without response, have x
// = 0.
void BoxProgram::solve_free(const MatrixView& W) {
    list_.clear();
    for (int i = 0; i < r_.size(); ++i)
        if (is_free_[i] && W(i, i) > 0.0) list_.push_back(i);
    const int n = static_cast<int>(list_.size());
    x_.setZero(r_.size());
    if (n == 0) return;
    auto A = A_.matrix(n, n);
    auto rhs = rhs_.vector(n), x = part_.vector(n);
    for (int j = 0; j < n; ++j) {
        rhs[j] = r_[list_[j]];
        for (int i = 0; i < n; ++i) A(i, j) = W(list_[i], list_[j]);
    }
    if (!solve_regular(n)) {
        solver_.factor_orthogonally(A, response_rank_threshold);
        solver_.solve(rhs, x);
    }
    for (int i = 0; i < n; ++i) x_[list_[i]] = x[i];
}

// Compute the acceleration scale of each element. Light and heavy bodies of a robot have separate scales.
void BoxProgram::measure(const MatrixView& W, const VecX& alpha0, const VecX& forces) {
    size_ = alpha0.cwiseAbs();
    for (int j = 0; j < forces.size(); ++j) size_ += std::abs(forces[j]) * W.col(j).cwiseAbs();
    noise_ = parameters.noise_of_others * size_.maxCoeff();
}

// Set start forces within the limits, close to `initial`: each at its limit or free.
void BoxProgram::start(const VecX& s, const VecX* initial) {
    const int n = static_cast<int>(s.size());
    f_.setZero(n);
    is_free_.assign(n, 1);
    for (int i = 0; i < n; ++i) {
        is_free_[i] = s[i] > 0.0 && (!initial || std::abs((*initial)[i]) < s[i] * (1.0 - parameters.limit_rounding));
        if (initial && s[i] > 0.0) f_[i] = is_free_[i] ? (*initial)[i] : (*initial)[i] > 0.0 ? s[i] : -s[i];
    }
}

// Primal active-set method. Steps from f lower f^T W f / 2 + alpha0^T f and stay in the box. Redundant elements cannot
// all stick if no forces cause the accelerations that they would have to cancel. The program then decreases without end
// along a direction with W d = 0, until one of the elements is at its limit and slips.
void BoxProgram::descend(const MatrixView& W, const VecX& alpha0, const VecX& s) {
    const int n = static_cast<int>(s.size());
    measure(W, alpha0, s);
    for (int it = 0; it < 20 * (n + 1) * (n + 1); ++it) {
        alpha_ = alpha0;
        alpha_.noalias() += W * f_;
        r_ = -alpha_;
        solve_free(W);
        left_ = alpha_;
        left_.noalias() += W * x_;
        bool endless = false;
        for (int i = 0; i < n; ++i) {
            if (!is_free_[i]) left_[i] = 0.0;
            endless |= std::abs(left_[i]) > parameters.zero_acceleration * size_[i] + noise_;
        }
        if (endless) x_ = -left_;
        double length = endless ? HUGE_VAL : 1.0;
        int hit = -1;
        for (int i = 0; i < n; ++i) {
            if (x_[i] == 0.0) continue;
            const double room = ((x_[i] > 0.0 ? s[i] : -s[i]) - f_[i]) / x_[i];
            if (room < length) { length = room; hit = i; }
        }
        f_ += length * x_;
        if (hit >= 0) {
            f_[hit] = x_[hit] > 0.0 ? s[hit] : -s[hit];
            is_free_[hit] = 0;
            continue;
        }
        alpha_ = alpha0;
        alpha_.noalias() += W * f_;
        int worst = -1;  // element that accelerates most along its force: it becomes free
        double most = parameters.rounding;
        for (int i = 0; i < n; ++i) {
            const double back = alpha_[i] * (f_[i] > 0.0 ? 1.0 : -1.0) - noise_;
            if (is_free_[i] || !(s[i] > 0.0) || !(back > most * size_[i])) continue;
            most = back / size_[i];
            worst = i;
        }
        if (worst < 0) return;
        is_free_[worst] = 1;
    }
}

// Projected Gauss-Seidel sweeps: each element in turn takes the force within its limits that is nearest to zero slip
// acceleration, with the forces of the others fixed. If block pivoting makes no progress, the elements that are at their
// limits after a few sweeps are a better start for it.
void BoxProgram::relax(const MatrixView& W, const VecX& alpha0, const VecX& s) {
    const int n = static_cast<int>(s.size());
    f_ = f_.cwiseMin(s).cwiseMax(-s);
    for (int sweep = 0; sweep < parameters.relaxing_sweeps; ++sweep)
        for (int i = 0; i < n; ++i)
            if (W(i, i) > 0.0)
                f_[i] = std::clamp(f_[i] - (alpha0[i] + W.col(i).dot(f_)) / W(i, i), -s[i], s[i]);
    for (int i = 0; i < n; ++i) is_free_[i] = std::abs(f_[i]) < s[i];
}

// Block principal pivoting. If the pivoting makes no progress, it starts again from relaxed forces. After the last of
// these starts it exchanges one element at a time (largest index). Return false if the free elements cannot all stick,
// or if pivoting does not end.
bool BoxProgram::pivot_blocks(const MatrixView& W, const VecX& alpha0, const VecX& s) {
    const int n = static_cast<int>(s.size());
    int fewest = n + 1, patience = parameters.max_stalled_rounds, relaxations = parameters.max_relaxations;
    for (int it = 0; it < 200 + 50 * n; ++it) {
        for (int i = 0; i < n; ++i)
            if (is_free_[i]) f_[i] = 0.0;
        r_ = -alpha0;
        r_.noalias() -= W * f_;
        solve_free(W);
        f_ += x_;
        alpha_ = alpha0;
        alpha_.noalias() += W * f_;
        measure(W, alpha0, f_);
        wrong_.clear();
        for (int i = 0; i < n; ++i) {
            if (is_free_[i] && std::abs(alpha_[i]) > parameters.zero_acceleration * size_[i] + noise_) return false;
            const bool outside = is_free_[i] && std::abs(f_[i]) > s[i] * (1.0 + parameters.rounding);
            const bool drives =
                !is_free_[i] && alpha_[i] * f_[i] > (parameters.rounding * size_[i] + noise_) * std::abs(f_[i]);
            if (outside || drives) wrong_.push_back(i);
        }
        if (wrong_.empty()) return true;
        if (static_cast<int>(wrong_.size()) < fewest) {
            fewest = static_cast<int>(wrong_.size());
            patience = parameters.max_stalled_rounds;
        } else if (--patience < 0 && relaxations-- > 0) {
            relax(W, alpha0, s);
            fewest = n + 1;
            patience = parameters.max_stalled_rounds;
            continue;
        } else if (patience < 0) {
            wrong_.assign(1, wrong_.back());
        }
        for (int i : wrong_) {
            if (is_free_[i]) f_[i] = f_[i] > 0.0 ? s[i] : -s[i];
            is_free_[i] = !is_free_[i];
        }
    }
    return false;
}

void BoxProgram::solve(const MatrixView& W, const VecX& alpha0, const VecX& s, const VecX* initial, VecX& f) {
    const int n = static_cast<int>(s.size());
    if (initial) initial_ = *initial;
    else initial_.setZero(n);
    alpha_.resize(n);
    left_.resize(n);
    f_.setZero(n);
    is_free_.assign(n, 1);
    for (int i = 0; initial && i < n; ++i) {
        is_free_[i] = std::abs(initial_[i]) < s[i] * (1.0 - parameters.limit_rounding);
        if (!is_free_[i]) f_[i] = initial_[i] > 0.0 ? s[i] : -s[i];
    }
    if (!pivot_blocks(W, alpha0, s)) {
        start(s, initial ? &initial_ : nullptr);
        descend(W, alpha0, s);
    }
    f = f_;
}

void BoxProgram::solve_all(const MatrixView& W, const VecX& r, VecX& x) {
    is_free_.assign(r.size(), 1);
    r_ = r;
    solve_free(W);
    x = x_;
}

VecX minimum_norm_solution(const MatX& W, const VecX& r) {
    VecX x;
    BoxProgram().solve_all(W, r, x);
    return x;
}

VecX box_program(const MatX& W, const VecX& alpha0, const VecX& s, const VecX* initial) {
    VecX f;
    BoxProgram().solve(W, alpha0, s, initial, f);
    return f;
}

}  // namespace pn
