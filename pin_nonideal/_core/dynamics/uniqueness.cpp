#include "dynamics/uniqueness.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/fixed_point/interval_solver.hpp"
#include "dynamics/reactions.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

using Solutions = Failure::Solutions;

Failure paradox(const Unknowns& u, double determinant, Solutions solutions = Solutions::unproven) {
    Failure failure(Failure::Kind::paradox, u.t, u.elements(), determinant);
    failure.solutions = solutions;
    return failure;
}

// Failure with the motions of solutions.
Failure with_motions(Unknowns& u, double determinant, const std::vector<VecX>& solutions) {
    Failure failure = paradox(u, determinant, solutions.size() > 1 ? Solutions::several : Solutions::unproven);
    for (const VecX& y : solutions) {
        u.set(y);
        u.motion();
        failure.limits.push_back(y.head(failure.elements.size()));
        failure.accelerations.push_back(u.w.now.a);
    }
    return failure;
}

double determinant_at(const ReactionEquation& equation, const VecX& y) {
    return ReactionNewton().factorize(equation, y);
}

// Sort solutions by their distance to `start`. Solutions with a negative or vanishing determinant come last.
void sort_by_distance(const ReactionEquation& equation, const VecX& start, std::vector<VecX>& roots) {
    VecX size = start;
    for (const VecX& y : roots) size = size.cwiseMax(y);
    size = size.cwiseMax(min_scale);
    const auto rank = [&](const VecX& y) {
        return std::pair(determinant_at(equation, y) < uniqueness_parameters.min_determinant,
                         (y - start).cwiseQuotient(size).cwiseAbs().maxCoeff());
    };
    std::sort(roots.begin(), roots.end(), [&](const VecX& y, const VecX& x) { return rank(y) < rank(x); });
}

// Select the solutions that are motions: limits are nonnegative, and unilateral contacts have no tension and no more
// than their minimum-norm share.
std::vector<VecX> motions_of(Unknowns& u, const std::vector<VecX>& roots) {
    std::vector<VecX> list;
    for (const VecX& y : roots)
        if (u.is_motion(y)) list.push_back(y);
    return list;
}

// Check if all sticking elements hold in the motion of a solution. If one of these elements slips, the motion has other
// modes.
bool holds(Unknowns& u, const VecX& y) {
    const ReleasedZeroLoads free(u.w);
    u.set(y);
    u.motion();
    for (int e = 0; e < static_cast<int>(u.p.frictions.size()); ++e)
        if (u.w.state.mode[e] == sticking &&
            !holding_force(u.p, u.w, e, u.t, u.q, u.v).is_within(uniqueness_parameters.limit_rounding))
            return false;
    return true;
}

// Check if all unknowns are limits of unilateral contacts. Such limits have only one branch in compression.
bool only_opening(const Unknowns& u) {
    const std::vector<int> list = u.elements();
    return std::all_of(list.begin(), list.end(), [&](int e) { return u.p.frictions[e].gap >= 0; });
}

// Check if a unilateral contact has tension. Such a contact is about to open.
bool pulls(const Unknowns& u, const VecX& y) {
    const std::vector<int> list = u.elements();
    for (size_t i = 0; i < list.size(); ++i)
        if (u.p.frictions[list[i]].gap >= 0 && y[i] < 0.0) return true;
    return false;
}

}  // namespace

void select_among_zero_load_sets(Unknowns& u, const VecX& start, VecX& y, const Failure& failure) {
    const std::vector<std::vector<char>> sets = zero_load_sets(u.p, u.w);
    if (sets.empty()) throw Failure(Failure::Kind::not_converged, u.t, u.elements());
    std::vector<VecX> motions;
    ReactionEquation equation;
    bool complete = true;
    for (const std::vector<char>& has_zero_load : sets) {
        const FrozenZeroLoads held(u.w, has_zero_load);
        u.equation(y, equation);
        if (!equation.finite()) throw Failure(Failure::Kind::not_finite, u.t);
        ReactionRoots roots;
        VecX linear = y;
        if (!only_opening(u)) roots = all_roots(equation);
        else if (ReactionNewton().solve(equation, linear)) roots.y.push_back(linear);
        complete &= roots.complete && !roots.at_edge;
        for (const VecX& root : roots.y)
            if (u.is_motion(root) && determinant_at(equation, root) > uniqueness_parameters.min_determinant)
                motions.push_back(root);
    }
    if (motions.empty() && !complete) throw Failure(Failure::Kind::not_converged, u.t, u.elements());
    if (motions.empty()) throw failure;
    const auto distance = [&](const VecX& root) { return (root - start).norm(); };
    y = *std::min_element(motions.begin(), motions.end(),
                          [&](const VecX& one, const VecX& other) { return distance(one) < distance(other); });
    u.w.state.unique = Uniqueness::not_shown;
}

void select_solution(Unknowns& u, const ReactionEquation& equation, const VecX& start, VecX& y, bool solved) {
    RunState& state = u.w.state;
    MatX L;
    equation.steepest(L);
    state.spectral_bound = spectral_bound(L);
    state.steps_since = 0;
    const bool contracts = state.spectral_bound < 1.0 - uniqueness_parameters.min_determinant;
    const bool in_pieces = shares_contact_loads(u.p, u.w);  // one zero-load set proves nothing about the others
    state.unique = contracts && !in_pieces ? Uniqueness::shown : Uniqueness::not_shown;
    if (contracts && solved) return;
    if (solved && determinant_at(equation, y) > uniqueness_parameters.min_determinant) {
        const bool linear = only_opening(u);
        if (linear && !in_pieces) state.unique = Uniqueness::shown;
        if (linear || pulls(u, y)) return;
    }
    ReactionRoots roots = all_roots(equation);
    std::vector<VecX>& found = roots.y;
    if (!found.empty() && !u.p.gaps.empty()) {
        sort_by_distance(equation, start, found);
        const std::vector<VecX> motions = motions_of(u, found);
        if (motions.empty() && in_pieces) {  // the search continues in the zero-load set of the nearest solution
            y = found.front();
            return;
        }
        if (!motions.empty()) found = motions;  // else a contact has tension and is about to open
        // A solution from infinite loads then has a contact in tension, unless det(I - dg/dy) is zero. A solution with
        // a negative determinant amplifies load changes, and the opening contact continues in another motion.
        if (only_opening(u))
            roots.at_edge = !(determinant_at(equation, found.front()) > uniqueness_parameters.min_determinant);
    }
    const double edge = std::min(1.0 - state.spectral_bound, 0.0);
    if (!roots.complete && solved && found.empty()) found.push_back(y);
    if (found.empty() && !roots.complete) throw Failure(Failure::Kind::not_converged, u.t, u.elements());
    if (found.empty()) throw paradox(u, edge, roots.at_edge ? Solutions::unproven : Solutions::none);
    sort_by_distance(equation, start, found);
    double min_root_determinant = HUGE_VAL;
    for (const VecX& root : found) min_root_determinant = std::min(min_root_determinant, determinant_at(equation, root));
    y = found.front();
    if (found.size() == 1 && !roots.at_edge) {
        if (roots.complete && !in_pieces) state.unique = Uniqueness::shown;
        return;
    }
    // Two motions exist only if all sticking elements hold in both. `start` may lie past an event that is not located
    // yet.
    const auto hold = std::count_if(found.begin(), found.end(), [&](const VecX& root) { return holds(u, root); });
    const bool shown = found.size() == 1 || hold > 1;
    if (!shown && determinant_at(equation, y) > uniqueness_parameters.min_determinant) return;
    state.unique = Uniqueness::several;
    VecX::Index widest = 0;
    (found.back() - y).cwiseQuotient((found.back() + y).cwiseMax(min_scale)).cwiseAbs().maxCoeff(&widest);
    u.w.now.several_element = u.elements()[widest];
    if (u.w.continues && determinant_at(equation, y) > uniqueness_parameters.min_determinant) return;
    if (found.size() == 1) throw with_motions(u, std::min(min_root_determinant, edge), found);
    throw with_motions(u, min_root_determinant, {found[0], found[1]});
}

void differentiate(Unknowns& u, const VecX& y, const VecX& g, double size, MatX& J) {
    J.resize(u.n, u.n);
    VecX shifted = y, image_there(u.n);
    const double h = uniqueness_parameters.difference_step * std::max(size, min_scale);
    for (int k = 0; k < u.n; ++k) {
        shifted[k] = y[k] + h;
        u.image(shifted, image_there);
        J.col(k) = (image_there - g) / h;
        shifted[k] = y[k];
    }
}

namespace {

// Unknowns of each law, [first, last): the limit of an element or the force of a user law.
std::vector<std::pair<int, int>> groups(const Unknowns& u) {
    std::vector<std::pair<int, int>> list;
    const int nv = u.p.mechanism.nv;
    int k = 0;
    u.each([&](size_t) { list.emplace_back(k, k + 1); ++k; },
           [&](const UserLaw&) { list.emplace_back(k, k + nv); k += nv; });
    return list;
}

// Limits of the friction elements without any load.
VecX constants(const Unknowns& u) {
    VecX c = VecX::Zero(u.n);
    int k = 0;
    u.each([&](size_t e) { c[k++] = limit_under(u.p, u.w, static_cast<int>(e), u.p.frictions[e].constant); },
           [](const UserLaw&) {});
    return c;
}

// Laws mostly grow with |load|, which has two branches: beyond the kink, the law's rows of dg/dy change sign. Call
// `visit` with dg/dy of each combination of branches, and the mirrored rows.
template <class Visit>
void each_mixture(const Unknowns& u, const MatX& J, const Visit& visit) {
    const auto laws = groups(u);
    const int m = static_cast<int>(laws.size());
    const bool all = m <= uniqueness_parameters.max_mixed_laws;
    for (int mixture = 1; mixture < (all ? 1 << m : m + 1); ++mixture) {
        MatX other = J;
        VecX mirrored = VecX::Zero(u.n);
        for (int i = 0; i < m; ++i) {
            if (all ? !(mixture >> i & 1) : i + 1 != mixture) continue;
            const int first = laws[i].first, count = laws[i].second - first;
            other.middleRows(first, count) *= -1.0;
            mirrored.segment(first, count).setOnes();
        }
        visit(other, mirrored);
    }
}

// Check if Newton's method from `start` converges to a solution other than y. If so, `start` is that solution.
bool leads_elsewhere(Unknowns& u, const VecX& y, VecX& start, double size) {
    bool is_other = false;
    attempt({Failure::Kind::not_finite, Failure::Kind::not_converged}, [&] {
        VecX g(u.n);
        MatX J;
        for (int it = 0; it < Unknowns::parameters.max_newton; ++it) {
            u.image(start, g);
            const VecX residual = g - start;
            const double scale = std::max({size, start.cwiseAbs().maxCoeff(), g.cwiseAbs().maxCoeff()});
            if (residual.cwiseAbs().maxCoeff() <= uniqueness_parameters.same_solution * scale) {
                is_other = (start - y).cwiseAbs().maxCoeff() > uniqueness_parameters.other_solution * scale;
                return;
            }
            differentiate(u, start, g, scale, J);
            start += solve(MatX::Identity(u.n, u.n) - J, residual);
        }
    });
    return is_other;
}

}  // namespace

double min_determinant(const Unknowns& u, const MatX& J) {
    const MatX I = MatX::Identity(u.n, u.n);
    double minimum = determinant(I - J);
    each_mixture(u, J, [&](const MatX& other, const VecX&) { minimum = std::min(minimum, determinant(I - other)); });
    return minimum;
}

void search_other_solutions(Unknowns& u, VecX& y, const MatX& J, double size) {
    RunState& state = u.w.state;
    const MatX I = MatX::Identity(u.n, u.n);
    const double determinant_at_y = determinant(I - J);
    const bool regular = determinant_at_y > uniqueness_parameters.min_determinant;
    state.unique = Uniqueness::not_shown;
    if (std::abs(determinant_at_y) <= uniqueness_parameters.min_determinant)
        throw paradox(u, std::min(determinant_at_y, 0.0));  // counts as zero
    const VecX bound = solve(I - J.cwiseAbs(), VecX::Ones(u.n));
    if ((bound.array() > 0.0).all()) return;
    const VecX c = constants(u), solution = y;
    each_mixture(u, J, [&](const MatX& other, const VecX& mirrored) {
        const double other_determinant = determinant(I - other);
        if ((regular && other_determinant > 0.0) || state.unique == Uniqueness::several) return;
        if (other_determinant == 0.0) throw paradox(u, other_determinant);
        VecX elsewhere = solution + solve(I - other, 2.0 * mirrored.cwiseProduct(c - solution));
        if (!leads_elsewhere(u, solution, elsewhere, size)) return;
        if (!u.w.continues) throw with_motions(u, std::min(determinant_at_y, other_determinant), {solution, elsewhere});
        state.unique = Uniqueness::several;
        if (!u.elements().empty()) u.w.now.several_element = u.elements().front();
        if (!regular) y = elsewhere;
    });
    if (!regular && state.unique != Uniqueness::several) throw paradox(u, determinant_at_y);
}

}  // namespace pn
