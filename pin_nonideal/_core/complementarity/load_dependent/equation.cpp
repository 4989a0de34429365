#include "complementarity/load_dependent/equation.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/box_lcp.hpp"
#include "math/decompositions.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

auto part(const VecX& x, const RestElement& e) { return x.segment(e.row, e.dim); }

// Compute G with W = G G^T, and the loads' derivatives times G^-T. Return false if forces that move nothing change a load.
bool energy_factor(const RestEquation& equation, MatX& G, MatX& loads) {
    const MatX& W = equation.W;
    Cholesky cholesky;
    if (cholesky.compute(W)) {
        G = cholesky.factor().triangularView<Eigen::Lower>();
        if ((G.diagonal().array().square() > RestEquation::parameters.min_response_pivot * W.diagonal().array()).all()) {
            loads = cholesky.solve_lower(equation.loads.transpose()).transpose();
            return true;
        }
    }
    const Spectrum spectrum = symmetric_spectrum(W);
    const double min_response = RestEquation::parameters.null_response * spectrum.values.cwiseAbs().maxCoeff();
    const int null = static_cast<int>((spectrum.values.array() <= min_response).count()), n = equation.n;
    const MatX along = spectrum.vectors.rightCols(n - null);
    const VecX root = spectrum.values.tail(n - null).cwiseSqrt();
    const MatX unmoving = equation.loads * spectrum.vectors.leftCols(null);
    if (unmoving.size() > 0 &&
        unmoving.cwiseAbs().maxCoeff() > RestEquation::parameters.unmoved * equation.loads.cwiseAbs().maxCoeff())
        return false;
    G = along * root.asDiagonal();
    loads = equation.loads * along * root.cwiseInverse().asDiagonal();
    return true;
}

}  // namespace

void RestEquation::respond(const VecX& x, VecX& alpha, FrictionLimits& limits) const {
    limits = FrictionLimits(static_cast<int>(elements.size()), n);
    if (evaluate_laws) {
        evaluate_laws(x, alpha, limits);
    } else {
        alpha = alpha0;
        alpha.noalias() += W * x;
        const VecX vectors = still + loads * x;
        for (size_t i = 0; i < elements.size(); ++i) {
            const RestElement& e = elements[i];
            double& limit = limits.size[i];
            limit = e.constant;
            limits.middle[e.row] = e.middle;
            if (e.directed) limit += std::max(vectors[3 * e.vector], 0.0);
            for (int k = e.vector; !e.directed && k < e.vector + e.vectors; ++k)
                limit += vectors.segment<3>(3 * k).norm();
        }
    }
    for (size_t i = 0; i < elements.size(); ++i) {
        limits.size[i] *= elements[i].factor;
        limits.middle[elements[i].row] *= elements[i].factor;
    }
    if (!(frozen > 0.0)) return;
    limits.size += frozen * (fixed.size - limits.size);
    limits.middle += frozen * (fixed.middle - limits.middle);
}

void RestEquation::differentiate(const VecX& x, MatX& dalpha, MatX& dlimits, MatX& dmiddle) const {
    const int count = static_cast<int>(elements.size());
    dlimits.setZero(count, n);
    dmiddle.setZero(n, n);
    if (evaluate_laws) {
        dalpha.resize(n, n);
        VecX alpha, alpha_there(n), shifted = x;
        FrictionLimits limits, limits_there;
        respond(x, alpha, limits);
        const double h = parameters.difference_step *
                         std::max({x.cwiseAbs().maxCoeff(), limits.size.cwiseAbs().maxCoeff(), min_scale});
        for (int k = 0; k < n; ++k) {
            shifted[k] = x[k] + h;
            respond(shifted, alpha_there, limits_there);
            dalpha.col(k) = (alpha_there - alpha) / h;
            dlimits.col(k) = (limits_there.size - limits.size) / h;
            dmiddle.col(k) = (limits_there.middle - limits.middle) / h;
            shifted[k] = x[k];
        }
        return;
    }
    dalpha = W;
    const VecX vectors = still + loads * x;
    for (int i = 0; i < count; ++i) {
        const RestElement& e = elements[i];
        if (e.directed && vectors[3 * e.vector] > 0.0) dlimits.row(i) += loads.row(3 * e.vector);
        for (int k = e.vector; !e.directed && k < e.vector + e.vectors; ++k) {
            const Eigen::Vector3d vector = vectors.segment<3>(3 * k);
            const double length = vector.norm();
            if (length > 0.0) dlimits.row(i) += vector.transpose() / length * loads.middleRows<3>(3 * k);
        }
        dlimits.row(i) *= (1.0 - frozen) * e.factor;
    }
}

VecX RestEquation::residual(const VecX& x) const {
    VecX alpha, out(n);
    FrictionLimits limits;
    respond(x, alpha, limits);
    const VecX from_middle = x - limits.middle;
    for (size_t i = 0; i < elements.size(); ++i) {
        const RestElement& e = elements[i];
        if (!e.may_stick) {
            out.segment(e.row, e.dim) = part(from_middle, e) + limits[i] * e.direction;
            continue;
        }
        const VecX argument = part(from_middle, e) - e.rho * part(alpha, e);
        const double length = argument.norm();
        if (length <= limits[i]) out.segment(e.row, e.dim) = e.rho * part(alpha, e);
        else out.segment(e.row, e.dim) = part(from_middle, e) - limits[i] / length * argument;
    }
    return out;
}

double RestEquation::force_scale(size_t i, const VecX& x, const FrictionLimits& limits) const {
    const RestElement& e = elements[i];
    return std::max({limits[i], part(x, e).norm(), e.rho * part(alpha0, e).norm(), min_scale});
}

double RestEquation::error(const VecX& x) const {
    VecX alpha;
    FrictionLimits limits;
    respond(x, alpha, limits);
    const VecX r = residual(x);
    double worst = 0.0;
    for (size_t i = 0; i < elements.size(); ++i)
        worst = std::max(worst, part(r, elements[i]).norm() / force_scale(i, x, limits));
    return std::isfinite(worst) ? worst : HUGE_VAL;
}

MatX RestEquation::jacobian(const VecX& x) const {
    VecX alpha;
    FrictionLimits limits;
    MatX dalpha, dlimits, dmiddle, J(n, n);
    respond(x, alpha, limits);
    differentiate(x, dalpha, dlimits, dmiddle);
    const VecX from_middle = x - limits.middle;
    const MatX slope = MatX::Identity(n, n) - dmiddle;
    for (size_t i = 0; i < elements.size(); ++i) {
        const RestElement& e = elements[i];
        auto rows = J.middleRows(e.row, e.dim);
        const MatX unit = slope.middleRows(e.row, e.dim);
        const VecX argument = part(from_middle, e) - e.rho * part(alpha, e);
        const double length = argument.norm();
        if (!e.may_stick) {
            rows = unit + e.direction * dlimits.row(i);
        } else if (length <= limits[i]) {
            rows = e.rho * dalpha.middleRows(e.row, e.dim);
        } else {
            const VecX along = argument / length;
            const MatX across = MatX::Identity(e.dim, e.dim) - along * along.transpose();
            rows = unit - along * dlimits.row(i) -
                   limits[i] / length * across * (unit - e.rho * dalpha.middleRows(e.row, e.dim));
        }
    }
    return J;
}

VecX RestEquation::holding_forces() const {
    VecX x = VecX::Zero(n), alpha;
    FrictionLimits limits;
    respond(x, alpha, limits);
    std::vector<int> rows;
    for (size_t i = 0; i < elements.size(); ++i) {
        const RestElement& e = elements[i];
        if (!e.may_stick) x.segment(e.row, e.dim) = part(limits.middle, e) - limits[i] * e.direction;
        for (int k = 0; e.may_stick && k < e.dim; ++k) rows.push_back(e.row + k);
    }
    const VecX driven = alpha0 + W * x;
    const MatX W_of_rows = W(rows, rows);
    x(rows) = minimum_norm_solution(W_of_rows, -driven(rows));
    return x;
}

std::vector<bool> RestEquation::sticks(const VecX& x) const {
    VecX alpha;
    FrictionLimits limits;
    respond(x, alpha, limits);
    const VecX from_middle = x - limits.middle;
    std::vector<bool> out;
    for (size_t i = 0; i < elements.size(); ++i) {
        const RestElement& e = elements[i];
        out.push_back(e.may_stick &&
                      (part(from_middle, e) - e.rho * part(alpha, e)).norm() <=
                       limits[i] * (1.0 + parameters.limit_rounding));
    }
    return out;
}

double RestEquation::determinant(const VecX& x) const {
    RestEquation still_limits = *this;
    VecX alpha;
    respond(x, alpha, still_limits.fixed);
    still_limits.frozen = 1.0;
    return pn::determinant(jacobian(x)) / pn::determinant(still_limits.jacobian(x));
}

double RestEquation::determinant_far_away() const {
    VecX alpha;
    FrictionLimits limits;
    respond(VecX::Zero(n), alpha, limits);
    MatX dalpha, dlimits, dmiddle;
    const int count = static_cast<int>(elements.size());
    double min_determinant = HUGE_VAL;
    for (int signs = 0; signs < 1 << std::min(count, parameters.max_signed_elements); ++signs) {
        VecX x = VecX::Zero(n);
        for (int i = 0; i < count; ++i) {
            const RestElement& e = elements[i];
            const double size = limits[i] + e.rho * part(alpha, e).norm(), sign = signs >> i & 1 ? 1.0 : -1.0;
            x.segment(e.row, e.dim) = parameters.unbounded_force * (e.may_stick ? VecX(sign * size * VecX::Unit(e.dim, 0))
                                                         : VecX(-size * e.direction));
        }
        differentiate(x, dalpha, dlimits, dmiddle);
        MatX slope = MatX::Zero(count, count);
        for (int i = 0; i < count; ++i)
            dlimits.row(i) += part(x, elements[i]).normalized().transpose() *
                              dmiddle.middleRows(elements[i].row, elements[i].dim);
        for (int i = 0; i < count; ++i)
            for (int j = 0; j < count; ++j)
                slope(i, j) =
                    dlimits.row(i).segment(elements[j].row, elements[j].dim).dot(part(x, elements[j]).normalized());
        min_determinant = std::min(min_determinant, determinant(MatX::Identity(count, count) - slope));
    }
    return min_determinant;
}

double contraction_bound(const RestEquation& equation) {
    if (!equation.is_load_dependent()) return 0.0;
    MatX G, loads;
    if (equation.evaluate_laws || !energy_factor(equation, G, loads)) return HUGE_VAL;
    const int count = static_cast<int>(equation.elements.size());
    VecX l = VecX::Zero(count), g(count);
    for (int i = 0; i < count; ++i) {
        const RestElement& e = equation.elements[i];
        for (int k = e.vector; k < e.vector + e.vectors; ++k) l[i] += e.factor * loads.middleRows<3>(3 * k).norm();
        g[i] = G.middleRows(e.row, e.dim).norm();
    }
    // Bound of sum l_i |G_i u| term by term, or by Cauchy and Schwarz with the weights l_i / g_i.
    const double one_by_one = l.dot(g);
    VecX root = VecX::Zero(equation.n);
    for (int i = 0; i < count; ++i)
        if (g[i] > 0.0)
            root.segment(equation.elements[i].row, equation.elements[i].dim).setConstant(std::sqrt(l[i] / g[i]));
    const MatX weighted = root.asDiagonal() * equation.W * root.asDiagonal();
    const double largest = weighted.cwiseAbs().rowwise().sum().maxCoeff();  // bound of the eigenvalues
    return std::min(one_by_one, std::sqrt(one_by_one * largest));
}

}  // namespace pn
