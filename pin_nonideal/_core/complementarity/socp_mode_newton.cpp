#include "complementarity/socp_mode_newton.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/second_order_cone.hpp"
#include "math/decompositions.hpp"

namespace pn {

namespace {

// With f = s x and slip accelerations alpha, the pairs z_e = (1, x_e) and y_e = (u_e, alpha_e) lie in the cone
// |tail| <= head. The pairs are complementary at the solution: x_e = -alpha_e / |alpha_e| or alpha_e = 0. A primal-dual
// interior-point method in Nesterov and Todd's scaling (Vandenberghe, "The CVXOPT linear and quadratic cone program
// solvers", 2010) needs some fifteen steps however singular W is. The method ends at the most even distribution of an
// undetermined load. Newton's method then solves the equations of the resulting modes to rounding.

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct ConeProgram {
    const MatX& W;
    const VecX& alpha0;
    const std::vector<int>& dims;
    const VecX& s;
    int n, elements;
    std::vector<int> at;
    VecX scale;            // s of each row
    double size = 0.0;     // scale of the accelerations
    MatX V, K;             // W s / size, and the matrix of a step
    VecX r0, x;
    std::vector<Cone> y;
    std::vector<Scaling> scalings;
    Cholesky factor;

    ConeProgram(const MatX& W_, const VecX& alpha0_, const std::vector<int>& dims_, const VecX& s_)
        : W(W_), alpha0(alpha0_), dims(dims_), s(s_), n(static_cast<int>(alpha0_.size())),
          elements(static_cast<int>(dims_.size())), scale(n), y(dims_.size()) {
        for (int e = 0, row = 0; e < elements; row += dims[e], ++e) {
            at.push_back(row);
            scale.segment(row, dims[e]).setConstant(s[e]);
        }
        size = alpha0.cwiseAbs().maxCoeff() + (W.cwiseAbs() * scale).maxCoeff();
        V = W * scale.asDiagonal() / size;
        r0 = alpha0 / size;
        x = VecX::Zero(n);
    }

    Vector3d tail(const VecX& rows, int e) const {
        Vector3d out = Vector3d::Zero();
        out.head(dims[e]) = rows.segment(at[e], dims[e]);
        return out;
    }
    Cone z(int e) const { return {1.0, tail(x, e)}; }

    double gap() const {
        double sum = 0.0;
        for (int e = 0; e < elements; ++e) sum += s[e] * z(e).dot(y[e]);
        return sum / s.sum();
    }

    bool inside() const {
        for (int e = 0; e < elements; ++e)
            if (!(z(e).determinant() > 0.0) || !(y[e].determinant() > 0.0)) return false;
        return true;
    }

    bool factorize() {
        K = scale.asDiagonal() * V;
        scalings.clear();
        for (int e = 0; e < elements; ++e) {
            scalings.emplace_back(z(e), y[e]);
            const Scaling& T = scalings.back();
            const Matrix3d block =
                s[e] / (T.root * T.root) * (2.0 * T.w.tail * T.w.tail.transpose() + Matrix3d::Identity());
            K.block(at[e], at[e], dims[e], dims[e]) += block.topLeftCorner(dims[e], dims[e]);
        }
        return factor.compute(K);
    }

    // Compute the step to z o y = target. `second` holds the second-order terms of the predictor step.
    void direction(double target, const std::vector<Cone>& second, VecX& dx, std::vector<Cone>& dy) const {
        VecX rhs(n);
        for (int e = 0; e < elements; ++e) {
            const Scaling& T = scalings[e];
            Cone d = product(T.scaled, T.scaled) * -1.0 - second[e];
            d.head += target;
            dy[e] = T.back(quotient(d, T.scaled));
            rhs.segment(at[e], dims[e]) = s[e] * dy[e].tail.head(dims[e]);
        }
        factor.solve(rhs, dx);
        for (int e = 0; e < elements; ++e) dy[e] = dy[e] - scalings[e].back(scalings[e].back({0.0, tail(dx, e)}));
    }

    double length(const VecX& dx, const std::vector<Cone>& dy) const {
        double least = HUGE_VAL;
        for (int e = 0; e < elements; ++e)
            least = std::min({least, room(z(e), {0.0, tail(dx, e)}), room(y[e], dy[e])});
        return least;
    }

    // Take a step. The tails of y become the accelerations of x, and the heads keep their excess over the tails.
    void advance(double step, const VecX& dx, const std::vector<Cone>& dy) {
        x += step * dx;
        const VecX alpha = V * x + r0;
        for (int e = 0; e < elements; ++e) {
            const Cone next = y[e] + dy[e] * step;
            y[e].tail = tail(alpha, e);
            y[e].head = y[e].tail.norm() + (next.head - next.tail.norm());
        }
    }

    void follow_central_path() {
        for (int e = 0; e < elements; ++e) {
            y[e].tail = tail(r0, e);
            y[e].head = y[e].tail.norm() + 1.0;
        }
        VecX dx(n);
        std::vector<Cone> dy(elements), second(elements);
        for (int it = 0; it < socp_parameters.max_steps && gap() > socp_parameters.gap_tolerance; ++it) {
            if (!factorize()) return;
            std::fill(second.begin(), second.end(), Cone());
            direction(0.0, second, dx, dy);
            const double left = 1.0 - std::min(1.0, length(dx, dy));
            for (int e = 0; e < elements; ++e)
                second[e] = product(scalings[e].back({0.0, tail(dx, e)}), scalings[e].forth(dy[e]));
            direction(left * left * left * gap(), second, dx, dy);
            const VecX x_before = x;
            const std::vector<Cone> y_before = y;
            advance(std::min(1.0, max_boundary_part * length(dx, dy)), dx, dy);
            if (inside()) continue;
            x = x_before;  // rounding allows no further progress
            y = y_before;
            return;
        }
    }

    // Solve the modes as equations by Newton's method: alpha = 0 for sticking elements, alpha + m x = 0 and |x| = 1 for
    // slipping ones.
    bool solve_modes(const std::vector<char>& slides, VecX& there, VecX& m) const {
        there = x;
        m.setZero();
        for (int e = 0; e < elements; ++e)
            if (slides[e]) m[e] = y[e].tail.norm();
        double last = HUGE_VAL;
        for (int it = 0; it < socp_parameters.max_mode_newton; ++it) {
            MatX J = MatX::Zero(n + elements, n + elements);
            VecX residual = VecX::Zero(n + elements);
            J.topLeftCorner(n, n) = V;
            residual.head(n) = V * there + r0;
            for (int e = 0; e < elements; ++e) {
                const auto xe = there.segment(at[e], dims[e]);
                if (!slides[e]) continue;
                J.block(at[e], at[e], dims[e], dims[e]).diagonal().array() += m[e];
                J.block(at[e], n + e, dims[e], 1) = xe;
                J.block(n + e, at[e], 1, dims[e]) = xe.transpose();
                residual.segment(at[e], dims[e]) += m[e] * xe;
                residual[n + e] = 0.5 * (xe.squaredNorm() - 1.0);
            }
            const double error = residual.cwiseAbs().maxCoeff();
            const bool done =
                error <= socp_parameters.mode_newton_tolerance || (error < socp_parameters.condition_slack && error >= last);
            last = error;
            if (done) break;
            const VecX step = least_squares(J, residual, response_rank_threshold);
            there -= step.head(n);
            m -= step.tail(elements);
        }
        return last < socp_parameters.condition_slack;
    }

    // Find the modes from the end of the central path. First guess: an element slips if its scaled acceleration y_e.head
    // exceeds 1 - |x_e|, the scaled distance of its force to the limit. Then solve the equations of these modes and switch
    // elements that contradict their modes, until none does. Return false if the modes do not settle.
    bool find_modes() {
        std::vector<char> slides(elements);
        for (int e = 0; e < elements; ++e) slides[e] = y[e].head > 1.0 - tail(x, e).norm();
        VecX there(n), m(elements);
        for (int round = 0; round < 2 * elements + 4; ++round) {
            int changed = 0, nearest = -1;
            if (solve_modes(slides, there, m)) {
                for (int e = 0; e < elements; ++e) {
                    const bool wrong = slides[e] ? m[e] < -socp_parameters.condition_slack
                                                 : tail(there, e).norm() > 1.0 + socp_parameters.condition_slack;
                    if (!wrong) continue;
                    slides[e] = !slides[e];
                    ++changed;
                }
                if (changed == 0) {
                    x = there;
                    return true;
                }
                continue;
            }
            for (int e = 0; e < elements; ++e)  // not all can stick: the element nearest to its limit slips
                if (!slides[e] && (nearest < 0 || tail(x, e).norm() > tail(x, nearest).norm())) nearest = e;
            if (nearest < 0) return false;
            slides[nearest] = 1;
        }
        return false;
    }

    VecX solve() {
        follow_central_path();
        const bool found = find_modes();
        for (int e = 0; e < elements; ++e) {  // slipping forces are exactly at their limits
            const double length = tail(x, e).norm();
            if (found ? length > 1.0 - socp_parameters.condition_slack : y[e].head > 1.0 - length)
                x.segment(at[e], dims[e]) /= length;
        }
        return scale.cwiseProduct(x);
    }
};

}  // namespace

VecX ball_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& s) {
    std::vector<int> rows, own_dims;
    std::vector<double> limits;
    for (int e = 0, row = 0; e < static_cast<int>(dims.size()); row += dims[e], ++e) {
        if (!(s[e] > 0.0)) continue;
        own_dims.push_back(dims[e]);
        limits.push_back(s[e]);
        for (int k = 0; k < dims[e]; ++k) rows.push_back(row + k);
    }
    const int n = static_cast<int>(rows.size());
    MatX own_W(n, n);
    VecX own_alpha(n), f = VecX::Zero(alpha0.size());
    for (int i = 0; i < n; ++i) {
        own_alpha[i] = alpha0[rows[i]];
        for (int j = 0; j < n; ++j) own_W(i, j) = W(rows[i], rows[j]);
    }
    if (n == 0 || own_alpha.isZero(0.0)) return f;
    const VecX own_f =
        ConeProgram(own_W, own_alpha, own_dims, Eigen::Map<const VecX>(limits.data(), limits.size())).solve();
    for (int i = 0; i < n; ++i) f[rows[i]] = own_f[i];
    return f;
}

VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const VecX& s,
                      const VecX* initial) {
    if (alpha0.size() == 0) return VecX::Zero(0);
    if (std::all_of(dims.begin(), dims.end(), [](int d) { return d == 1; })) return box_program(W, alpha0, s, initial);
    return ball_program(W, alpha0, dims, s);
}

VecX friction_program(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const FrictionLimits& limits,
                      const VecX* initial) {
    if (limits.middle.isZero(0.0)) return friction_program(W, alpha0, dims, limits.size, initial);
    const VecX from_middle = initial ? VecX(*initial - limits.middle) : VecX();
    return limits.middle + friction_program(W, alpha0 + W * limits.middle, dims, limits.size,
                                            initial ? &from_middle : nullptr);
}

VecX onset_accelerations(const MatX& W, const VecX& alpha0, const std::vector<int>& dims, const FrictionLimits& limits) {
    constexpr double beyond = 1e-6;  // part of the load by which it is raised
    const VecX more = (1.0 + beyond) * alpha0;
    return more + W * friction_program(W, more, dims, limits);
}

}  // namespace pn
