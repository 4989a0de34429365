#include "complementarity/cone/newton.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

using Eigen::Vector3d;

// Data of the projection of one element's tangential rows.
struct Disk {
    Vector3d z = Vector3d::Zero();
    double radius = 0.0, length = 0.0;
    int first = 0, dim = 0;  // tangential rows

    bool sticks() const { return length <= radius; }
};

Disk disk_of(const ConeProblem& p, int e, const Eigen::Ref<const VecX>& f, const Eigen::Ref<const VecX>& w) {
    const ConeElement& element = p.elements[e];
    const double rho = p.stiffness(e);
    const bool contact = element.is(ConeKind::contact);
    Disk disk;
    disk.first = p.at[e] + contact;
    disk.dim = element.dim - contact;
    disk.radius = element.bound * (contact ? std::max(0.0, f[p.at[e]] - rho * w[p.at[e]]) : 1.0);
    disk.z.head(disk.dim) = f.segment(disk.first, disk.dim) - rho * w.segment(disk.first, disk.dim);
    disk.length = disk.z.norm();
    return disk;
}

}  // namespace

// Evaluate F of the equations F = 0. Return its squared length.
double ConeNewton::evaluate(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    auto w = w_.vector(p.n), F = F_.vector(p.n);
    p.respond(f, w);
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        const double rho = p.stiffness(e);
        const int i = p.at[e];
        if (element.is(ConeKind::equality)) {
            F.segment(i, element.dim) = rho * w.segment(i, element.dim);
            continue;
        }
        if (element.is(ConeKind::contact)) F[i] = std::min(f[i], rho * w[i]);
        const Disk disk = disk_of(p, e, f, w);
        if (disk.sticks() && disk.radius > 0.0) F.segment(disk.first, disk.dim) = rho * w.segment(disk.first, disk.dim);
        else if (disk.dim > 0)
            F.segment(disk.first, disk.dim) = f.segment(disk.first, disk.dim)
                - (disk.length > 0.0 ? disk.radius / disk.length : 0.0) * disk.z.head(disk.dim);
    }
    return F.squaredNorm();
}

double ConeNewton::relative(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    auto size = size_.vector(p.size());
    const auto F = F_.vector(p.n);
    p.force_scales(f, size);
    double error = 0.0;
    for (int e = 0; e < p.size(); ++e) {
        const double miss = F.segment(p.at[e], p.elements[e].dim).cwiseAbs().maxCoeff();
        if (!(miss <= HUGE_VAL)) return HUGE_VAL;
        if (miss > 0.0) error = std::max(error, miss / size[e]);
    }
    return error;
}

double ConeNewton::error(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    evaluate(p, f);
    return relative(p, f);
}

void ConeNewton::differentiate(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    auto J = J_.matrix(p.n, p.n);
    const auto w = w_.vector(p.n);
    const auto W = p.W();
    J.setZero();
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        const double rho = p.stiffness(e);
        const int i = p.at[e], d = element.dim;
        if (element.is(ConeKind::equality)) {
            J.middleRows(i, d) = rho * W.middleRows(i, d);
            continue;
        }
        const bool contact = element.is(ConeKind::contact), closed = contact && f[i] > rho * w[i];
        if (closed) J.row(i) = rho * W.row(i);
        else if (contact) J(i, i) = 1.0;
        const Disk disk = disk_of(p, e, f, w);
        if (disk.sticks() && disk.radius > 0.0) {
            J.middleRows(disk.first, disk.dim) = rho * W.middleRows(disk.first, disk.dim);
            continue;
        }
        const Vector3d t = disk.length > 0.0 ? Vector3d(disk.z / disk.length) : Vector3d::Zero();
        const double turn = disk.length > 0.0 ? disk.radius / disk.length : 0.0;
        for (int a = 0; a < disk.dim; ++a) {
            const int row = disk.first + a;
            for (int b = 0; b < disk.dim; ++b) {  // z changes direction
                const double part = turn * ((a == b ? 1.0 : 0.0) - t[a] * t[b]);
                J(row, disk.first + b) -= part;
                J.row(row) += rho * part * W.row(disk.first + b);
            }
            J(row, row) += 1.0;
            if (!closed) continue;
            J(row, i) -= element.bound * t[a];  // the limit grows with the normal force
            J.row(row) += element.bound * t[a] * rho * W.row(i);
        }
    }
}

// Take the longest step that reduces the error. Return false if no step does, after `max_blind_steps` without decrease.
bool ConeNewton::advance(const ConeProblem& p, Eigen::Ref<VecX> f, double& merit) {
    auto step = step_.vector(p.n), ahead = ahead_.vector(p.n);
    double length = 1.0;
    for (int halving = 0; halving < parameters.max_halvings; ++halving, length *= 0.5) {
        ahead = f - length * step;
        const double new_merit = evaluate(p, ahead);
        if (new_merit < (1.0 - 2.0 * parameters.decrease * length) * merit) {
            f = ahead;
            merit = new_merit;
            return true;
        }
    }
    if (++blind_ > parameters.max_blind_steps) return false;
    f -= step;
    merit = evaluate(p, f);
    return merit < HUGE_VAL;
}

// Check if the equations at f differ from those factored last. A slipping element has different equations at every point.
bool ConeNewton::update_modes(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    constexpr signed char curved = -1, unknown = -2;
    const auto w = w_.vector(p.n);
    mode_.resize(p.size(), unknown);
    bool changes = false;
    for (int e = 0; e < p.size(); ++e) {
        const ConeElement& element = p.elements[e];
        signed char now = 0;
        if (!element.is(ConeKind::equality)) {
            const int i = p.at[e];
            const bool closed = element.is(ConeKind::contact) && f[i] > p.stiffness(e) * w[i];
            const Disk disk = disk_of(p, e, f, w);
            const bool sticks = disk.sticks() && disk.radius > 0.0;
            now = disk.dim == 0 || sticks || disk.radius == 0.0 ? static_cast<signed char>(1 + 2 * closed + sticks)
                                                                : curved;
        }
        changes |= now == curved || now != mode_[e];
        mode_[e] = now;
    }
    return changes;
}

int ConeNewton::orientation(const ConeProblem& p, const Eigen::Ref<const VecX>& f) {
    evaluate(p, f);
    differentiate(p, f);
    solver_.factor(J_.matrix(p.n, p.n));
    mode_.clear();
    return solver_.orientation();
}

double ConeNewton::solve(const ConeProblem& p, Eigen::Ref<VecX> f, int max_steps) {
    auto best = best_.vector(p.n), step = step_.vector(p.n), F = F_.vector(p.n);
    auto J = J_.matrix(p.n, p.n);
    double merit = evaluate(p, f), last = relative(p, f), least = last;
    best = f;
    blind_ = 0;
    int stalled = 0;
    regular_ = false;
    for (int it = 0; it < max_steps && last > parameters.tolerance; ++it, ++steps_) {
        if (update_modes(p, f) || it == 0) {
            differentiate(p, f);
            solver_.factor(J);
            regular_ = solver_.regular();
        }
        solver_.solve(F, step);
        if (!advance(p, f, merit)) break;
        const double now = relative(p, f);
        if (now < least) {
            least = now;
            best = f;
        }
        if (least < parameters.stall_tolerance && now > 0.25 * last && ++stalled > parameters.max_stalled_steps) break;
        last = now;
    }
    f = best;
    return least;
}

}  // namespace pn
