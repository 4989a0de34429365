#include "complementarity/cone/solver.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

ConeStatus ConeComplementarity::solve(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                                      const std::vector<ConeElement>& elements, bool warm, Eigen::Ref<VecX> f,
                                      bool may_keep_shares) {
    const int steps = newton_.steps();
    problem_.pose(W, w0, elements);
    const int n = problem_.n;
    auto x = even_.vector(n);
    if (warm) x = f.cwiseQuotient(problem_.scale()) / problem_.force_unit();
    else x.setZero();
    least_miss_ = HUGE_VAL;
    bool found = search(x, warm);
    if (!found && brief_) return ConeStatus::failed;
    ConeStatus status = found ? ConeStatus::solved : find_certificate(problem_, certificate_);
    if (status == ConeStatus::jammed) found = grow_friction(x);  // a solution may still exist
    if (status == ConeStatus::failed) found = grow_friction(x) || scatter(x) || take_nearest(x);
    if (found && shares_alike_) stiffen(x);
    unique_shares_ = newton_.regular();
    const bool as_it_was = warm && may_keep_shares && newton_.steps() == steps;
    if (found && !unique_shares_ && !as_it_was) {
        auto even = f_.vector(n);
        even = x;
        const bool shorter = shares_.even_out(problem_, even);
        if (shorter && newton_.solve(problem_, even, parameters.few_steps) <= std::max(parameters.evened, error_))
            x = even;
    }
    if (found) tidy(x);
    f = problem_.force_unit() * problem_.scale().cwiseProduct(x);
    if (found) return ConeStatus::solved;
    if (certificate_.size() > 0) certificate_ = problem_.scale().cwiseProduct(certificate_).eval();
    return status;
}

bool ConeComplementarity::hold(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                               const std::vector<ConeElement>& elements, Eigen::Ref<VecX> f) {
    problem_.pose(W, w0, elements);
    grown_ = problem_;
    grown_.associated = true;
    auto x = even_.vector(problem_.n), w = w_.vector(problem_.n);
    x.setZero();
    path_.follow(grown_, x, ConePath::Slip::stands);
    if (!x.allFinite()) return false;
    problem_.respond(x, w);
    if (w.cwiseAbs().maxCoeff() > parameters.held) return false;
    if (!polish(x, parameters.more_steps) || !stands_still(x)) return false;
    unique_shares_ = newton_.regular();
    auto even = f_.vector(problem_.n);
    even = x;
    if (!unique_shares_ && shares_.even_out(problem_, even) &&
        newton_.solve(problem_, even, parameters.few_steps) <= std::max(parameters.evened, error_))
        x = even;
    tidy(x);
    f = problem_.force_unit() * problem_.scale().cwiseProduct(x);
    return true;
}

// Check if all velocities are rounding of their own terms, along the normal and across it. The largest velocity of all
// would hide slip beside much lighter bodies.
bool ConeComplementarity::stands_still(const Eigen::Ref<const VecX>& f) {
    auto w = w_.vector(problem_.n);
    problem_.respond(f, w);
    const double all = 1.0 + (problem_.W().cwiseAbs() * f.cwiseAbs()).maxCoeff();
    const auto stands = [&](int begin, int end) {
        double speed = 0.0, terms = 0.0;
        for (int i = begin; i < end; ++i) {
            speed = std::max(speed, std::abs(w[i]));
            terms = std::max(terms, std::abs(problem_.w0()[i]) + problem_.W().row(i).cwiseAbs().dot(f.cwiseAbs()));
        }
        return speed <= parameters.still * terms + parameters.velocity_rounding * all;
    };
    for (int e = 0; e < problem_.size(); ++e) {
        const int begin = problem_.at[e], end = begin + problem_.elements[e].dim;
        const int tail = begin + problem_.elements[e].is(ConeKind::contact);
        if (!stands(begin, tail) || !stands(tail, end)) return false;
    }
    return true;
}

// Run Newton's method from f. f changes only if the result is a solution.
bool ConeComplementarity::polish(Eigen::Ref<VecX> f, int most_steps) {
    auto there = f_.vector(problem_.n);
    there = f;
    error_ = newton_.solve(problem_, there, most_steps);
    if (!(error_ <= parameters.tolerance) || there.cwiseAbs().maxCoeff() > parameters.no_force) return false;
    f = there;
    return true;
}

bool ConeComplementarity::search(Eigen::Ref<VecX> f, bool warm) {
    if (problem_.n == 0) return true;
    if (polish(f, parameters.first_steps)) return true;
    if (warm) {
        f.setZero();
        if (polish(f, parameters.first_steps)) return true;
    }
    path_.follow(problem_, f, ConePath::Slip::follows);
    if (polish(f, parameters.more_steps)) return true;
    return !brief_ && (approach(f) || take_turns(f) || relax(f));
}

// Solve with compliance to the whole forces that decreases to its limit. f is kept if this gives no solution.
bool ConeComplementarity::stiffen(Eigen::Ref<VecX> f) {
    grown_ = problem_;
    auto there = x_.vector(problem_.n);
    there.setZero();
    for (double compliance = parameters.first_compliance; compliance >= parameters.min_compliance;
         compliance *= parameters.softer) {
        grown_.W() = problem_.W();
        grown_.W().diagonal().array() += compliance;
        if (newton_.solve(grown_, there, parameters.more_steps) <= parameters.tolerance) continue;
        path_.follow(grown_, there, ConePath::Slip::follows);
        if (!there.allFinite() || !(newton_.solve(grown_, there, parameters.more_steps) <= parameters.tolerance))
            return false;
    }
    const double error = error_;
    f_.vector(problem_.n) = there;
    there = f;
    f = f_.vector(problem_.n);
    if (polish(f, parameters.few_steps)) return true;
    f = there;
    error_ = error;
    return false;
}

// Remove rounding: no force pulls, and none leaves its cone.
void ConeComplementarity::tidy(Eigen::Ref<VecX> f) const {
    for (int e = 0; e < problem_.size(); ++e) {
        const ConeElement& element = problem_.elements[e];
        const int i = problem_.at[e], head = element.is(ConeKind::contact);
        if (element.is(ConeKind::equality)) continue;
        if (head && !(f[i] > 0.0)) f[i] = 0.0;
        auto tail = f.segment(i + head, element.dim - head);
        const double limit = element.bound * (head ? f[i] : 1.0), length = tail.norm();
        if (length > limit) tail *= limit / length;
    }
}

}  // namespace pn
