#include "complementarity/cone/interior_point.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

double root_of(const ConeElement& e) { return circular_scale(e.kind, tail_rows(e), e.bound); }

}  // namespace

Vector3d ConeInteriorPoint::tail(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& x) const {
    Vector3d out = Vector3d::Zero();
    const int rows = tail_rows(p.elements[e]);
    out.head(rows) = x.segment(p.at[e] + head_rows(p.elements[e]), rows);
    return out;
}

// Return the force of element e, or its change, as a vector of its cone. The head of a box is given.
Cone ConeInteriorPoint::force(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& f, double head) const {
    const double root = root_of(p.elements[e]);
    if (p.elements[e].is(ConeKind::contact)) head = root * f[p.at[e]];
    return {head, tail(p, e, f) / root};
}

void ConeInteriorPoint::start(const ConeProblem& p, Eigen::Ref<VecX> f, Slip slip) {
    mode_ = slip;
    if (static_cast<int>(points_.size()) < p.size()) points_.resize(p.size());
    auto w = w_.vector(p.n);
    p.respond(f, w);
    for (int e = 0; e < p.size(); ++e) {
        PathPoint& s = points_[e];
        s.speed = p.associated ? 0.0 : tail(p, e, w).norm();
        s.slip.setZero();
        s.z = s.u = {1.0, Vector3d::Zero()};
    }
    f.setZero();
    for (int e = 0; e < p.size(); ++e) {
        if (p.elements[e].is(ConeKind::box)) points_[e].z.head = p.elements[e].bound;
        if (p.elements[e].is(ConeKind::contact)) f[p.at[e]] = 1.0 / root_of(p.elements[e]);
    }
}

// Update the slip speeds, and the residual of u = w + (mu |w_t|, 0).
void ConeInteriorPoint::update(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    auto w = w_.vector(p.n), miss = miss_.vector(p.n);
    p.respond(f, w);
    miss = w;
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        PathPoint& s = points_[e];
        if (element.is(ConeKind::equality)) continue;
        const int rows = tail_rows(element), first = p.at[e] + head_rows(element);
        const double root = root_of(element);
        if (mode_ == Slip::follows && element.slides() && rows > 0 && !p.associated) {
            const Vector3d slip = tail(p, e, w);
            s.speed = std::sqrt(slip.squaredNorm() + parameters.smooth_speed * parameters.smooth_speed);
            s.slip = slip / s.speed;
        }
        miss.segment(first, rows) -= s.u.tail.head(rows) / root;
        if (element.is(ConeKind::contact)) miss[p.at[e]] += (rows > 0 ? element.bound * s.speed : 0.0) - s.u.head * root;
        if (rows < element.dim - head_rows(element)) miss.segment(first, element.dim - head_rows(element)).setZero();
    }
}

bool ConeInteriorPoint::factorize(const ConeProblem& p) {
    auto K = K_.matrix(p.n, p.n);
    K = p.W();
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        if (element.is(ConeKind::equality)) continue;
        PathPoint& s = points_[e];
        const int i = p.at[e], rows = tail_rows(element), first = i + head_rows(element);
        const int idle = element.dim - head_rows(element) - rows;
        if (idle > 0) {  // tangential rows without friction
            K.middleRows(first, idle).setZero();
            K.block(first, first, idle, idle).setIdentity();
            if (element.is(ConeKind::box)) continue;
        }
        s.scale();
        const Scaling& T = s.scaling;
        const double root = root_of(element), inverse = 1.0 / (T.root * T.root);
        const Matrix3d block = inverse / (root * root) * (2.0 * T.w.tail * T.w.tail.transpose() + Matrix3d::Identity());
        K.block(first, first, rows, rows) += block.topLeftCorner(rows, rows);
        if (element.is(ConeKind::box)) continue;
        K(i, i) += root * root * inverse * (2.0 * T.w.head * T.w.head - 1.0);
        const Vector3d cross = -2.0 * inverse * T.w.head * T.w.tail;
        K.block(first, i, rows, 1) += cross.head(rows);
        K.block(i, first, 1, rows) += cross.head(rows).transpose();
        if (mode_ == Slip::follows && !p.associated)
            for (int k = 0; k < rows; ++k) K.row(i) += element.bound * s.slip[k] * p.W().row(first + k);
    }
    solver_.factor(K);
    return true;
}

// Compute the step to z o y = target that leaves `keep` of the residual, with the second-order terms of the predictor step.
void ConeInteriorPoint::direction(const ConeProblem& p, double target, double keep) {
    auto rhs = rhs_.vector(p.n), step = step_.vector(p.n);
    rhs = (keep - 1.0) * miss_.vector(p.n);
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        PathPoint& s = points_[e];
        if (!has_cone(element)) continue;
        s.aim(target);
        const int rows = tail_rows(element), first = p.at[e] + head_rows(element);
        const double root = root_of(element);
        rhs.segment(first, rows) += s.du.tail.head(rows) / root;
        if (element.is(ConeKind::contact)) rhs[p.at[e]] += root * s.du.head;
    }
    solver_.solve(rhs, step);
    for (int e = 0; e < p.size(); ++e) {
        if (has_cone(p.elements[e])) points_[e].follow(force(p, e, step, 0.0));
    }
}

double ConeInteriorPoint::length(const ConeProblem& p) const {
    double longest = HUGE_VAL;
    const Eigen::Map<const VecX> step = step_.vector(p.n);
    for (int e = 0; e < p.size(); ++e) {
        if (!has_cone(p.elements[e])) continue;
        longest = std::min(longest, points_[e].room_for(force(p, e, step, 0.0)));
    }
    return longest;
}

double ConeInteriorPoint::gap(const ConeProblem& p) const {
    double sum = 0.0;
    int count = 0;
    for (int e = 0; e < p.size(); ++e) {
        if (!has_cone(p.elements[e])) continue;
        sum += points_[e].z.dot(points_[e].u);
        ++count;
    }
    return count > 0 ? sum / count : 0.0;
}

void ConeInteriorPoint::follow(const ConeProblem& p, Eigen::Ref<VecX> f, Slip slip) {
    start(p, f, slip);
    auto step = step_.vector(p.n), kept = kept_.vector(p.n);
    for (int it = 0; it < parameters.max_steps; ++it, ++steps_) {
        update(p, f);
        const double now = gap(p);
        const double miss = miss_.vector(p.n).cwiseAbs().maxCoeff();
        if (now < parameters.gap_tolerance && miss < parameters.gap_tolerance * 10.0) return;
        factorize(p);
        direction(p, 0.0, 0.0);
        const double left = 1.0 - std::min(1.0, length(p)), sigma = left * left * left;
        for (int e = 0; e < p.size(); ++e)
            if (has_cone(p.elements[e])) points_[e].correct(force(p, e, step, 0.0));
        direction(p, sigma * now, sigma);
        const double a = std::min(1.0, max_boundary_part * length(p));
        if (!(a > parameters.min_step)) return;
        kept = f;
        f += a * step;
        bool inside = true;
        for (int e = 0; e < p.size(); ++e)
            if (has_cone(p.elements[e])) inside &= points_[e].move(force(p, e, f, points_[e].z.head), a);
        if (inside) continue;
        f = kept;  // rounding allows no further progress
        return;
    }
}

}  // namespace pn
