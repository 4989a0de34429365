#include "complementarity/blocks/interior_point.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Return a force of a point's element, or its change, as a vector of its cone. The head of a box is given.
Cone BlockInteriorPoint::force(const Point& point, const VecX& f, double head) const {
    Cone out{head, Vector3d::Zero()};
    if (point.heads) out.head = point.root * f[point.row] / point.unit[0];
    for (int k = point.heads; k < point.heads + point.tails; ++k)
        out.tail[k - point.heads] = f[point.row + k] / (point.unit[k] * point.root);
    return out;
}

void BlockInteriorPoint::start(const BlockProblem& p, const BlockNewton& newton, const Island& island, VecX& f) {
    G_.resize(9 * p.elements.size());
    for (VecX* rows : {&z_, &df_, &dw_}) rows->resize(p.rows);
    dx_.resize(p.free.size());
    speed_ = newton.unit();
    points_.clear();
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        Point point;
        point.row = e.row;
        point.dim = e.dim();
        point.in_path = has_cone(e.cone);
        point.heads = head_rows(e.cone);
        point.tails = e.cone.is(ConeKind::equality) ? e.dim() : tail_rows(e.cone);
        for (int k = 0; k < e.dim(); ++k) point.unit[k] = std::sqrt(newton.stiffness(e.row + k)) * speed_;
        if (point.heads && point.tails > 0) point.mu = e.cone.bound * point.unit[0] / point.unit[1];
        point.root = circular_scale(e.cone.kind, point.tails, point.mu);
        point.z = point.u = {1.0, Vector3d::Zero()};
        if (!point.heads) point.z.head = e.cone.bound / point.unit[0];
        f.segment(e.row, e.dim()).setZero();
        if (point.heads) f[e.row] = point.unit[0] / point.root;
        points_.push_back(point);
    }
}

// Update the slip speeds and the residuals.
void BlockInteriorPoint::update(Slip slips, const VecX& w) {
    for (Point& point : points_) {
        point.residual.setZero();
        for (int k = 0; k < point.heads + point.tails; ++k)
            point.residual[k] = w[point.row + k] * point.unit[k] / (speed_ * speed_);
        if (!point.in_path) continue;
        if (slips != Slip::none && point.heads && point.tails > 0) {
            const Vector3d slip(point.residual[1], point.tails > 1 ? point.residual[2] : 0.0, 0.0);
            point.speed = std::hypot(slip.norm(), parameters.smooth_speed);
            point.slip = slip / point.speed;
        }
        if (point.heads) point.residual[0] += point.mu * point.speed - point.u.head * point.root;
        point.residual.segment(point.heads, point.tails) -= point.u.tail.head(point.tails) / point.root;
    }
}

// Compute S^-1 in closed form: a numerical inverse would lose the digits of forces near the boundary of their cone.
void BlockInteriorPoint::invert(Point& point) const {
    if (!point.in_path) {
        point.inverse = Matrix3d::Identity() / parameters.proximal;
        return;
    }
    const int heads = point.heads, tails = point.tails;
    const double beta = point.scaling.root * point.scaling.root, square = point.root * point.root;
    const Cone& w = point.scaling.w;
    const Matrix3d outer = 2.0 * w.tail * w.tail.transpose();
    point.inverse.setIdentity();
    auto across = point.inverse.block(heads, heads, tails, tails);
    if (!heads) {
        across = beta * (Matrix3d::Identity() - outer / (1.0 + outer.trace())).topLeftCorner(tails, tails);
        return;
    }
    across = beta * square * (Matrix3d::Identity() + outer).topLeftCorner(tails, tails);
    point.inverse(0, 0) = beta / square * (2.0 * w.head * w.head - 1.0);
    point.inverse.block(1, 0, tails, 1) = 2.0 * beta * w.head * w.tail.head(tails);
    point.inverse.block(0, 1, 1, tails) = point.inverse.block(1, 0, tails, 1).transpose();
}

void BlockInteriorPoint::scale(const Island& island, Slip slip) {
    for (size_t i = 0; i < points_.size(); ++i) {
        Point& point = points_[i];
        const int rows = point.heads + point.tails;
        if (point.in_path) point.PathPoint::scale();
        invert(point);
        Matrix3d E = Matrix3d::Identity();
        if (point.heads && slip == Slip::follows)
            E.block(0, 1, 1, point.tails) = point.mu * point.slip.head(point.tails).transpose();
        const Matrix3d scaled = point.inverse * E;
        double* G = &G_[9 * island.elements[i]];
        std::fill(G, G + 9, 0.0);
        for (int r = 0; r < rows; ++r)
            for (int c = 0; c < rows; ++c)
                G[r * point.dim + c] = scaled(r, c) * point.unit[r] * point.unit[c] / (speed_ * speed_);
    }
}

// Compute the step to z o u = target that leaves the fraction `keep` of the residual.
void BlockInteriorPoint::direction(const BlockProblem& p, const Island& island, const BlockFactor& factor, double target,
                                   double keep) {
    for (int n : island.nodes) dx_.segment(p.nodes[n].first, p.nodes[n].size).setZero();
    for (Point& point : points_) {
        Vector3d r = (keep - 1.0) * point.residual;
        if (point.in_path) {
            point.aim(target);
            r.segment(point.heads, point.tails) += point.du.tail.head(point.tails) / point.root;
            if (point.heads) r[0] += point.root * point.du.head;
        }
        r = point.inverse * r;
        for (int k = 0; k < point.dim; ++k)
            z_[point.row + k] = k < point.heads + point.tails ? point.unit[k] * r[k] : 0.0;
    }
    p.push(island.elements, z_, dx_);
    factor.solve(dx_);
    p.respond(island.elements, dx_, dw_);
    for (size_t i = 0; i < points_.size(); ++i) {
        Point& point = points_[i];
        const double* G = &G_[9 * island.elements[i]];
        for (int k = 0; k < point.dim; ++k) {
            double step = z_[point.row + k];
            for (int l = 0; l < point.dim; ++l) step -= G[k * point.dim + l] * dw_[point.row + l];
            df_[point.row + k] = step;
        }
        if (point.in_path) point.follow(force(point, df_, 0.0));
    }
}

double BlockInteriorPoint::length() const {
    double longest = HUGE_VAL;
    for (const Point& point : points_)
        if (point.in_path) longest = std::min(longest, point.room_for(force(point, df_, 0.0)));
    return longest;
}

double BlockInteriorPoint::gap() const {
    double sum = 0.0;
    int count = 0;
    for (const Point& point : points_) {
        if (!point.in_path) continue;
        sum += point.z.dot(point.u);
        ++count;
    }
    return count > 0 ? sum / count : 0.0;
}

double BlockInteriorPoint::residual() const {
    double largest = 0.0;
    for (const Point& point : points_) largest = std::max(largest, point.residual.cwiseAbs().maxCoeff());
    return largest;
}

// Take a fraction of the step. Return false, without a change of f, if rounding leads out of a cone.
bool BlockInteriorPoint::move(double part, VecX& f) {
    before_ = f;
    bool inside = true;
    for (Point& point : points_) {
        f.segment(point.row, point.dim) += part * df_.segment(point.row, point.dim);
        if (point.in_path) inside &= point.move(force(point, f, point.z.head), part);
    }
    if (!inside) f = before_;
    return inside;
}

void BlockInteriorPoint::follow(const BlockProblem& p, const BlockNewton& newton, const Island& island,
                                BlockFactor& factor, Slip slip, VecX& f, VecX& x, VecX& w) {
    factor.analyse(p, island);
    start(p, newton, island, f);
    newton.move(p, island, f, x, w);
    for (int step = 0; step < parameters.max_steps; ++step, ++steps_) {
        update(slip, w);
        const double now = gap();
        if (now < parameters.gap_tolerance && residual() < parameters.residual_tolerance) return;
        scale(island, slip);
        if (!factor.factor(p, island, G_, slip != Slip::follows)) return;
        direction(p, island, factor, 0.0, 0.0);
        const double left = 1.0 - std::min(1.0, length()), sigma = left * left * left;
        for (Point& point : points_)
            if (point.in_path) point.correct(force(point, df_, 0.0));
        direction(p, island, factor, sigma * now, sigma);
        const double part = std::min(1.0, max_boundary_part * length());
        if (!(part > parameters.min_step) || !move(part, f)) return;
        newton.move(p, island, f, x, w);
    }
}

}  // namespace pn
