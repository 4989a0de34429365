// Searches of ConeComplementarity far from a solution: proximal points, alternation, projected Gauss-Seidel,
// continuation in the friction, and random starts.
#include <algorithm>
#include <cmath>
#include <random>

#include "complementarity/cone/solver.hpp"

namespace pn {

// Proximal point algorithm (Rockafellar, SIAM J. Control Optim. 14, 1976). Each element yields in proportion to the
// change of its force. Every problem on the way is then regular, however many elements share a load. Forces that no
// longer change cause no compliance.
bool ConeComplementarity::approach(Eigen::Ref<VecX> f) {
    grown_ = problem_;
    auto last = x_.vector(problem_.n), nearest = nearest_.vector(problem_.n);
    last.setZero();
    double compliance = parameters.first_compliance, before = HUGE_VAL;
    for (int turn = 0; turn < parameters.most_approaches && !(least_miss_ <= parameters.unchangeable); ++turn) {
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
            path_.follow(grown_, f, ConePath::Slip::follows);
            if (f.allFinite()) error = newton_.solve(grown_, f, parameters.more_steps);
        }
        compliance = std::max(parameters.min_compliance, 0.5 * compliance);
        if (!(error <= parameters.tolerance) || f.cwiseAbs().maxCoeff() > parameters.no_force) continue;
        last = f;
        if (polish(f, parameters.few_steps)) return true;
        error = newton_.error(problem_, f);
        if (error > parameters.lasts * before && error < least_miss_) {
            nearest = f;
            least_miss_ = error;
        }
        before = error;
    }
    return least_miss_ <= parameters.unchangeable && take_nearest(f);
}

// Set f to the stored forces of smallest residual, if this residual is accepted.
bool ConeComplementarity::take_nearest(Eigen::Ref<VecX> f) {
    if (!(least_miss_ <= most_miss_)) return false;
    f = nearest_.vector(problem_.n);
    error_ = least_miss_;
    return true;
}

// Alternate between slip speeds and the forces for fixed slip speeds (Cadoux, "Méthodes d'optimisation pour la
// dynamique non régulière", 2009).
bool ConeComplementarity::take_turns(Eigen::Ref<VecX> f) {
    f.setZero();
    for (int turn = 0; turn < parameters.max_alternations; ++turn) {
        path_.follow(problem_, f, ConePath::Slip::stands);
        if (!f.allFinite()) f.setZero();
        if (polish(f, parameters.more_steps)) return true;
    }
    return false;
}

// Projected Gauss-Seidel: set one element after the other to the nearest force in its cone.
bool ConeComplementarity::relax(Eigen::Ref<VecX> f) {
    auto w = w_.vector(problem_.n), x = x_.vector(problem_.n);
    f.setZero();
    problem_.respond(f, w);
    for (int round = 0; round < parameters.most_rounds; ++round) {
        for (int sweep = 0; sweep < parameters.sweeps; ++sweep)
            for (int e = 0; e < problem_.size(); ++e) {
                const ConeElement& element = problem_.elements[e];
                const int i = problem_.at[e], d = element.dim, head = element.is(ConeKind::contact);
                auto fe = f.segment(i, d);
                auto before = x.head(d);
                before = fe;
                fe -= parameters.relaxation * problem_.stiffness(e) * w.segment(i, d);
                if (head) fe[0] = std::max(fe[0], 0.0);
                const double length = fe.tail(d - head).norm(), limit = element.bound * (head ? fe[0] : 1.0);
                if (!element.is(ConeKind::equality) && length > limit) fe.tail(d - head) *= limit / length;
                before -= fe;
                for (int k = 0; k < d; ++k) w -= before[k] * problem_.W().col(i + k);
            }
        if (!f.allFinite()) return false;
        if (polish(f, parameters.more_steps)) return true;
    }
    return false;
}

// Continuation from zero friction, where the problem is convex, to full friction.
bool ConeComplementarity::grow_friction(Eigen::Ref<VecX> f) {
    grown_ = problem_;
    double reached = 0.0, stretch = parameters.first_friction_part;
    auto there = x_.vector(problem_.n);
    f.setZero();
    for (int tried = 0; tried < parameters.most_stretches && stretch > parameters.min_friction_part; ++tried) {
        const double next = std::min(1.0, reached + stretch);
        for (int e = 0; e < problem_.size(); ++e) grown_.elements[e].bound = next * problem_.elements[e].bound;
        there = f;
        double error = newton_.solve(grown_, there, parameters.more_steps);
        for (int turn = 0; turn < parameters.few_turns && !(error <= parameters.tolerance); ++turn) {
            path_.follow(grown_, there, turn == 0 ? ConePath::Slip::follows : ConePath::Slip::stands);
            if (!there.allFinite()) break;
            auto end = f_.vector(problem_.n);
            end = there;
            error = newton_.solve(grown_, end, parameters.more_steps);
            if (error <= parameters.tolerance) there = end;
        }
        if (!(error <= parameters.tolerance)) {
            stretch *= 0.3;
            continue;
        }
        f = there;
        reached = next;
        stretch *= 2.0;
        if (reached == 1.0) return polish(f, parameters.more_steps);
    }
    return false;
}

// Random starts with a fixed seed.
bool ConeComplementarity::scatter(Eigen::Ref<VecX> f) {
    std::minstd_rand lot(1);
    for (int start = 0; start < parameters.most_starts; ++start) {
        for (int i = 0; i < problem_.n; ++i) f[i] = 4.0 * (lot() / double(std::minstd_rand::max()) - 0.5);
        for (int e = 0; e < problem_.size(); ++e)
            if (problem_.elements[e].is(ConeKind::contact)) f[problem_.at[e]] = 2.0 * std::abs(f[problem_.at[e]]);
        if (polish(f, parameters.more_steps)) return true;
        path_.follow(problem_, f, ConePath::Slip::stands);
        if (f.allFinite() && polish(f, parameters.more_steps)) return true;
    }
    return false;
}

}  // namespace pn
