#include "complementarity/cone/minimum_norm.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Point of a set nearest to z, and its derivative by z.
struct Nearest {
    Vector3d point = Vector3d::Zero();
    Matrix3d derivative = Matrix3d::Zero();
};

Nearest of_ray(const Vector3d& z, const Vector3d& direction) {
    const double along = z.dot(direction) / direction.squaredNorm();
    if (along <= 0.0) return {};
    return {along * direction, direction * direction.transpose() / direction.squaredNorm()};
}

Nearest of_cone(const Vector3d& z, double mu) {
    const double length = z.tail<2>().norm();
    if (length <= mu * z[0]) return {z, Matrix3d::Identity()};
    if (mu * length <= -z[0]) return {};
    Vector3d edge(1.0, 0.0, 0.0), across(0.0, 0.0, 0.0);
    if (length > 0.0) {
        edge.tail<2>() = mu / length * z.tail<2>();
        across << 0.0, -z[2] / length, z[1] / length;
    }
    Nearest out = of_ray(z, edge);
    const double along = out.point[0];
    if (length > 0.0) out.derivative += along * mu / length * across * across.transpose();
    return out;
}

Nearest of_ball(const Vector3d& z, double radius) {
    const double length = z.norm();
    if (length <= radius) return {z, Matrix3d::Identity()};
    const Vector3d t = z / length;
    return {radius * t, radius / length * (Matrix3d::Identity() - t * t.transpose())};
}

// Project the forces z of an element on the set that the modes of w allow. A slipping box keeps the forces `given`.
Nearest nearest(const ConeElement& element, const Vector3d& z, const Vector3d& w, const Vector3d& given) {
    if (element.is(ConeKind::equality)) return {z, Matrix3d::Identity()};
    if (element.is(ConeKind::box))
        return w.norm() > MinimumNormForces::parameters.rest_velocity ? Nearest{given, Matrix3d::Zero()}
                                                               : of_ball(z, element.bound);
    if (w[0] > MinimumNormForces::parameters.rest_velocity) return {};
    Vector3d slip(0.0, w[1], w[2]);
    if (element.bound == 0.0 || slip.norm() == 0.0 || slip.norm() <= MinimumNormForces::parameters.rest_velocity)
        return of_cone(z, element.bound);
    return of_ray(z, Vector3d::UnitX() - element.bound / slip.norm() * slip);
}

}  // namespace

// Compute orthonormal columns of the forces that W responds to, in unscaled units. Returns their number.
int MinimumNormForces::span(const ConeProblem& p) {
    auto transpose = transpose_.matrix(p.n, p.n);
    transpose = p.W().transpose();
    solver_.factor_orthogonally(transpose);
    int rank = solver_.rank();
    auto basis = basis_.matrix(p.n, rank);
    solver_.range(basis);
    for (int i = 0; i < p.n; ++i) basis.row(i) /= p.scale()[i];
    for (int pass = 0; pass < 2; ++pass)  // Gram-Schmidt, twice for rounding
        for (int c = 0; c < rank; ++c) {
            for (int k = 0; k < c; ++k) basis.col(c) -= basis.col(k).dot(basis.col(c)) * basis.col(k);
            basis.col(c).normalize();
        }
    return rank;
}

// Compute g = P(z), and the stacked blocks of its derivative.
void MinimumNormForces::project(const ConeProblem& p, const Eigen::Ref<const VecX>& z, Eigen::Ref<VecX> g,
                         bool differentiate) {
    const auto w = w_.vector(p.n), given = given_.vector(p.n);
    auto D = D_.matrix(p.n, 3);
    for (int e = 0; e < p.size(); ++e) {
        ConeElement element = p.elements[e];
        const int i = p.at[e], d = element.dim;
        if (element.is(ConeKind::box)) element.bound *= p.scale()[i];
        Vector3d ze = Vector3d::Zero(), we = ze, ge = ze;
        ze.head(d) = z.segment(i, d);
        we.head(d) = w.segment(i, d);
        ge.head(d) = given.segment(i, d);
        const Nearest there = nearest(element, ze, we, ge);
        g.segment(i, d) = there.point.head(d);
        if (differentiate) D.middleRows(i, d) = there.derivative.topRows(d);
    }
}

double MinimumNormForces::miss(const ConeProblem& p, const Eigen::Ref<const VecX>& y, int rank) {
    auto z = z_.vector(p.n), g = g_.vector(p.n);
    const auto E = basis_.matrix(p.n, rank);
    z.noalias() = E * y;
    project(p, z, g, false);
    auto miss = miss_.vector(rank);
    miss = -target_.vector(rank);
    miss.noalias() += E.transpose() * g;
    return miss.norm();
}

bool MinimumNormForces::minimize_norm(const ConeProblem& p, Eigen::Ref<VecX> f) {
    const int rank = span(p);
    const auto E = basis_.matrix(p.n, rank);
    auto w = w_.vector(p.n), given = given_.vector(p.n);
    auto DE = DE_.matrix(p.n, rank), J = J_.matrix(rank, rank);
    auto y = y_.vector(rank), target = target_.vector(rank), step = step_.vector(rank), ahead = ahead_.vector(rank);
    p.respond(f, w);
    given = p.scale().cwiseProduct(f);
    target.noalias() = E.transpose() * given;
    y = target;
    const double size = given.norm();
    double now = miss(p, y, rank);
    for (int it = 0; it < parameters.max_steps && now > parameters.tolerance * size; ++it) {
        project(p, z_.vector(p.n), g_.vector(p.n), true);
        for (int e = 0; e < p.size(); ++e) {
            const int i = p.at[e], d = p.elements[e].dim;
            DE.middleRows(i, d).noalias() = D_.matrix(p.n, 3).block(i, 0, d, d).lazyProduct(E.middleRows(i, d));
        }
        J.noalias() = E.transpose() * DE;
        J.diagonal().array() += parameters.damping * std::min(1.0, now / size);
        solver_.factor(J);
        solver_.solve(miss_.vector(rank), step);
        double length = 1.0, there = HUGE_VAL;
        for (int halving = 0; halving < parameters.max_halvings && !(there < now); ++halving, length *= 0.5) {
            ahead = y - length * step;
            there = miss(p, ahead, rank);
        }
        if (!(there < now)) break;
        y = ahead;
        now = there;
    }
    now = miss(p, y, rank);
    if (!(now <= parameters.stall_tolerance * size)) return false;
    f = g_.vector(p.n).cwiseQuotient(p.scale());
    return true;
}

}  // namespace pn
