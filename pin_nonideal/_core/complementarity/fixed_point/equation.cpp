#include "complementarity/fixed_point/equation.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

void ReactionEquation::resize(int size, int vectors) {
    constant.resize(size);
    element.resize(vectors);
    directed.assign(vectors, 0);
    offset.resize(3, vectors);
    columns.resize(3 * vectors, size);
}

Eigen::Vector3d ReactionEquation::vector(int k, const VecX& y, double s) const {
    return s * offset.col(k) + columns.middleRows<3>(3 * k) * y;
}

bool ReactionEquation::finite() const { return constant.allFinite() && offset.allFinite() && columns.allFinite(); }

void ReactionEquation::image(const VecX& y, double s, VecX& g) const {
    g = s * constant;
    for (int k = 0; k < vectors(); ++k) {
        const Eigen::Vector3d load = vector(k, y, s);
        g[element[k]] += directed[k] ? load[0] : load.norm();
    }
}

void ReactionEquation::slope(const VecX& y, double s, MatX& J) const {
    J.setZero(size(), size());
    for (int k = 0; k < vectors(); ++k) {
        if (directed[k]) {
            J.row(element[k]) += columns.row(3 * k);
            continue;
        }
        const Eigen::Vector3d load = vector(k, y, s);
        const double length = load.norm();
        if (length == 0.0) continue;
        J.row(element[k]).noalias() += (load / length).transpose() * columns.middleRows<3>(3 * k);
    }
}

void ReactionEquation::steepest(MatX& L) const {
    L.setZero(size(), size());
    for (int k = 0; k < vectors(); ++k)
        for (int j = 0; j < size(); ++j) L(element[k], j) += columns.block<3, 1>(3 * k, j).norm();
}

VecX ReactionEquation::steepest_in_s() const {
    VecX bound = constant;
    for (int k = 0; k < vectors(); ++k) bound[element[k]] += offset.col(k).norm();
    return bound;
}

double ReactionNewton::factorize(const ReactionEquation& equation, const VecX& y) {
    equation.slope(y, 1.0, matrix);
    matrix = -matrix;
    matrix.diagonal().array() += 1.0;
    factor.compute(matrix);
    return factor.determinant();
}

bool ReactionNewton::solve(const ReactionEquation& equation, VecX& y) {
    double last = HUGE_VAL;
    for (int pass = 0; pass < parameters.max_steps; ++pass) {
        equation.image(y, 1.0, image);
        residual = image - y;
        const double error = residual.cwiseAbs().maxCoeff(), size = y.cwiseAbs().maxCoeff();
        if (!std::isfinite(error)) return false;
        if (error <= parameters.tolerance * size || (error >= last && error <= parameters.stall_tolerance * size))
            return true;
        last = error;
        factorize(equation, y);
        factor.solve(residual, step);
        if (!step.allFinite()) return false;
        y += step;
    }
    return false;
}

// For any positive u, max (L u)_i / u_i is an upper bound of the largest eigenvalue (Collatz and Wielandt).
double spectral_bound(const MatX& L) {
    double best = L.rowwise().sum().maxCoeff();
    if (best <= spectral_bound_parameters.min_improved) return best;
    VecX u = VecX::Ones(L.rows());
    for (int pass = 0; pass < spectral_bound_parameters.max_passes; ++pass) {
        const VecX next = L * u;
        const double before = best;
        best = std::min(best, next.cwiseQuotient(u).maxCoeff());
        if (best <= spectral_bound_parameters.min_improved ||
            (pass > 0 && before - best <= spectral_bound_parameters.settled * best))
            break;
        u = next + spectral_bound_parameters.kept_weight * best * u;
        u /= u.maxCoeff();
    }
    return best;
}

}  // namespace pn
