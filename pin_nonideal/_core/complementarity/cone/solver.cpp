#include "complementarity/cone/solver.hpp"

#include <algorithm>
#include <cmath>
#include <random>

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
    bool is_solved = search(x);
    if (!is_solved && brief_) return ConeStatus::failed;
    const ConeStatus status = is_solved ? ConeStatus::solved : find_certificate(problem_, certificate_);
    if (status == ConeStatus::failed) is_solved = random_restarts(x, [] { return true; });
    const int needed = newton_.steps() - steps;
    const bool as_it_was = warm && may_keep_shares && needed == 0;
    const bool continues = warm && (newton_.regular() || needed <= parameters.few_steps);
    if (is_solved && uniform_compliance_ && !continues) compliance_continuation(x);
    unique_shares_ = newton_.regular();
    if (is_solved && !unique_shares_ && !as_it_was) {
        auto even = f_.vector(n);
        even = x;
        const bool shorter = minimum_norm_.minimize_norm(problem_, even);
        const double allowed = std::max(parameters.minimum_norm_tolerance, error_);
        if (shorter && newton_.solve(problem_, even, parameters.few_steps) <= allowed)
            x = even;
    }
    if (is_solved) tidy(x);
    f = problem_.force_unit() * problem_.scale().cwiseProduct(x);
    if (is_solved) return ConeStatus::solved;
    if (certificate_.size() > 0) certificate_ = problem_.scale().cwiseProduct(certificate_).eval();
    return status;
}

bool ConeComplementarity::replace_reversed(Eigen::Ref<VecX> f) {
    auto x = even_.vector(problem_.n);
    x = f.cwiseQuotient(problem_.scale()) / problem_.force_unit();
    if (!unique_shares_ || newton_.orientation(problem_, x) >= 0) return false;
    if (!random_restarts(x, [&] { return newton_.orientation(problem_, x) > 0; })) return false;
    tidy(x);
    f = problem_.force_unit() * problem_.scale().cwiseProduct(x);
    return true;
}

bool ConeComplementarity::hold(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                               const std::vector<ConeElement>& elements, Eigen::Ref<VecX> f) {
    problem_.pose(W, w0, elements);
    grown_ = problem_;
    grown_.associated = true;
    auto x = even_.vector(problem_.n), w = w_.vector(problem_.n);
    x.setZero();
    interior_point_.follow(grown_, x, ConeInteriorPoint::Slip::stands);
    if (!x.allFinite()) return false;
    problem_.respond(x, w);
    if (w.cwiseAbs().maxCoeff() > parameters.path_rest_velocity) return false;
    if (!polish(x, parameters.more_steps) || !stands_still(x)) return false;
    unique_shares_ = newton_.regular();
    auto even = f_.vector(problem_.n);
    even = x;
    if (!unique_shares_ && minimum_norm_.minimize_norm(problem_, even) &&
        newton_.solve(problem_, even, parameters.few_steps) <= std::max(parameters.minimum_norm_tolerance, error_))
        x = even;
    tidy(x);
    f = problem_.force_unit() * problem_.scale().cwiseProduct(x);
    return true;
}

// Check if all velocities are rounding error of their own terms, along the normal and across it. The largest velocity of all
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
        return speed <= parameters.rest_velocity * terms + parameters.velocity_rounding * all;
    };
    for (int e = 0; e < problem_.size(); ++e) {
        const int begin = problem_.at[e], end = begin + problem_.elements[e].dim;
        const int tail = begin + problem_.elements[e].is(ConeKind::contact);
        if (!stands(begin, tail) || !stands(tail, end)) return false;
    }
    return true;
}

// Run Newton's method from f. f changes only if the result is a solution.
bool ConeComplementarity::polish(Eigen::Ref<VecX> f, int max_steps) {
    auto there = f_.vector(problem_.n);
    there = f;
    error_ = newton_.solve(problem_, there, max_steps);
    if (!(error_ <= parameters.tolerance) || there.cwiseAbs().maxCoeff() > parameters.no_force) return false;
    f = there;
    return true;
}

bool ConeComplementarity::search(Eigen::Ref<VecX> f) {
    if (problem_.n == 0) return true;
    if (polish(f, parameters.first_steps)) return true;
    interior_point_.follow(problem_, f, ConeInteriorPoint::Slip::follows);
    if (polish(f, parameters.more_steps)) return true;
    return !brief_ && proximal_point(f);
}

// Solve with a compliance of all forces, which decreases to its minimum. Keep f if no solution is found.
bool ConeComplementarity::compliance_continuation(Eigen::Ref<VecX> f) {
    grown_ = problem_;
    auto there = x_.vector(problem_.n);
    there.setZero();
    for (double compliance = parameters.first_compliance; compliance >= parameters.min_compliance;
         compliance *= parameters.compliance_ratio) {
        grown_.W() = problem_.W();
        grown_.W().diagonal().array() += compliance;
        if (newton_.solve(grown_, there, parameters.more_steps) <= parameters.tolerance) continue;
        interior_point_.follow(grown_, there, ConeInteriorPoint::Slip::follows);
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

// Proximal point algorithm (Rockafellar, SIAM J. Control Optim. 14, 1976). Each element yields in proportion to the
// change of its force. Every intermediate problem is then regular, however many elements share a load. Forces that no
// longer change cause no compliance.
bool ConeComplementarity::proximal_point(Eigen::Ref<VecX> f) {
    grown_ = problem_;
    auto last = x_.vector(problem_.n), best = best_.vector(problem_.n);
    last.setZero();
    double compliance = parameters.first_compliance, before = HUGE_VAL, least = HUGE_VAL;
    for (int turn = 0; turn < parameters.max_proximal_steps && !(least <= parameters.stalled_residual); ++turn) {
        grown_.W() = problem_.W();
        grown_.W().diagonal().array() += compliance;
        grown_.w0() = problem_.w0() - compliance * last;
        f = last;
        double error = newton_.solve(grown_, f, parameters.more_steps);
        if (!(error <= parameters.tolerance)) {
            f.setZero();
            error = newton_.solve(grown_, f, parameters.more_steps);
        }
        if (!(error <= parameters.tolerance)) {
            interior_point_.follow(grown_, f, ConeInteriorPoint::Slip::follows);
            if (f.allFinite()) error = newton_.solve(grown_, f, parameters.more_steps);
        }
        compliance = std::max(parameters.min_compliance, 0.5 * compliance);
        if (!(error <= parameters.tolerance) || f.cwiseAbs().maxCoeff() > parameters.no_force) continue;
        last = f;
        if (polish(f, parameters.few_steps)) return true;
        error = newton_.error(problem_, f);
        if (error > parameters.stall_ratio * before && error < least) {
            best = f;
            least = error;
        }
        before = error;
    }
    if (!(least <= max_residual_)) return false;
    f = best;
    error_ = least;
    return true;
}

// Random starts with a fixed seed. Newton's method runs from each start, then from the end of the central path for the
// slip speeds of its result.
template <class Accept>
bool ConeComplementarity::random_restarts(Eigen::Ref<VecX> f, const Accept& accept) {
    std::minstd_rand lot(1);
    for (int start = 0; start < parameters.max_random_starts; ++start) {
        for (int i = 0; i < problem_.n; ++i) f[i] = 4.0 * (lot() / double(std::minstd_rand::max()) - 0.5);
        for (int e = 0; e < problem_.size(); ++e)
            if (problem_.elements[e].is(ConeKind::contact)) f[problem_.at[e]] = 2.0 * std::abs(f[problem_.at[e]]);
        if (polish(f, parameters.more_steps) && accept()) return true;
        interior_point_.follow(problem_, f, ConeInteriorPoint::Slip::stands);
        if (f.allFinite() && polish(f, parameters.more_steps) && accept()) return true;
    }
    return false;
}

}  // namespace pn
