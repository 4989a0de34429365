#include "dynamics/implicit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/law_forces.hpp"
#include "dynamics/slip.hpp"
#include "dynamics/solution.hpp"
#include "dynamics/split.hpp"

namespace pn {

namespace {

constexpr double reaction_tolerance = 4e-15;  // relative change of y that counts as rounding
constexpr double newton_tolerance = 3.2e-14;  // the same behind a linear solve
constexpr double stalled = 1e-12;             // Newton's error that no longer falls is rounding where it is below this
constexpr double slow_change = 1e-13;         // a change that contracts slowly is followed where it is above this
constexpr double good_contraction = 0.25;     // slower fixed points go to Newton's method
constexpr double difference = 1e-7;           // part of the unknowns' size: square root of the rounding, with a margin
constexpr double least_determinant_told = 1e-8;  // differences tell no smaller one from zero
constexpr double least_size = 1e-300;         // of unknowns that are all zero
constexpr int fixed_point_limit = 30, newton_limit = 30;
constexpr int most_mixed = 6;                 // laws whose mixtures of branches are all looked at; else one by one
constexpr double same_solution = 1e-9;        // relative residual at which a point is a solution
constexpr double other_solution = 1e-6;       // relative distance beyond which it is another one

struct Implicit {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    int n = 0;

    Implicit(const Program& program, Workspace& workspace, double time, const VecX& q_, const VecX& v_)
        : p(program), w(workspace), t(time), q(q_), v(v_), n(count()) {}

    int nv() const { return p.mechanism.nv; }

    bool is_unknown(size_t e) const { return p.frictions[e].reaction == Reaction::total && slips(w.state.mode[e]); }

    double load(size_t e) { return w.now.load[e] = load_limit(p, w, p.frictions[e], t, q, v); }

    // Number of unknowns.
    int count() const {
        int k = 0;
        each_unknown([&](size_t) { ++k; }, [&](const UserLaw&) { k += nv(); });
        return k;
    }

    // Calls the first for each slipping element, then the second for each law, in the order of the unknowns.
    template <class OnElement, class OnLaw>
    void each_unknown(const OnElement& on_element, const OnLaw& on_law) const {
        for (size_t e = 0; e < p.frictions.size(); ++e)
            if (is_unknown(e)) on_element(e);
        each_law<UserLaw>(p.laws, [&](const UserLaw& law) { if (law.reaction == Reaction::total) on_law(law); });
    }

    void set(const VecX& y) {
        int k = 0;
        each_unknown([&](size_t e) { w.now.limit[e] = y[k++]; },
                     [&](const UserLaw& law) { w.now.user_C[law.index] = y.segment(k, nv()); k += nv(); });
    }

    // The motion for the limits and user forces in the workspace.
    void motion() {
        w.now.C = w.now.base_C;
        add_slip_forces(p, w, true, w.now.C);
        each_unknown([](size_t) {}, [&](const UserLaw& law) { w.now.C += w.now.user_C[law.index]; });
        w.scratch.trial = w.now.F + w.now.C;
        solve_acceleration(p, w, w.scratch.trial);
    }

    void image(const VecX& y, VecX& g) {
        set(y);
        motion();
        // A stage that has run away is no case for the laws, a user's above all.
        if (!std::isfinite(w.now.a.squaredNorm())) throw Failure(Failure::Kind::not_finite, t);
        int k = 0;
        each_unknown([&](size_t e) { g[k++] = limit_under(p, w, e, load(e)); },
                     [&](const UserLaw& law) { g.segment(k, nv()) = ask(p, law, w, t, q, v); k += nv(); });
        ++w.counters.iterations;
    }

    std::vector<int> unknown_elements() const {
        std::vector<int> list;
        each_unknown([&](size_t e) { list.push_back(static_cast<int>(e)); }, [](const UserLaw&) {});
        return list;
    }

    [[noreturn]] void paradox(double determinant) const {
        throw Failure(Failure::Kind::paradox, t, unknown_elements(), determinant);
    }

    // dg/dy by differences, scaled by the unknowns' size.
    void differentiate(const VecX& y, const VecX& g, double size) {
        w.scratch.jacobian.resize(n, n);
        VecX shifted = y, image_there(n);
        const double h = difference * std::max(size, least_size);
        for (int k = 0; k < n; ++k) {
            shifted[k] = y[k] + h;
            image(shifted, image_there);
            w.scratch.jacobian.col(k) = (image_there - g) / h;
            shifted[k] = y[k];
        }
    }

    // Unknowns of one law, [first, last): a friction's limit or a user law's force.
    std::vector<std::pair<int, int>> groups() const {
        std::vector<std::pair<int, int>> list;
        int k = 0;
        each_unknown([&](size_t) { list.emplace_back(k, k + 1); ++k; },
                     [&](const UserLaw&) { list.emplace_back(k, k + nv()); k += nv(); });
        return list;
    }

    // What a friction's limit is without any load.
    VecX constants() const {
        VecX c = VecX::Zero(n);
        int k = 0;
        each_unknown([&](size_t e) { c[k++] = limit_under(p, w, e, p.frictions[e].constant); }, [](const UserLaw&) {});
        return c;
    }

    // Laws grow with |load|, which has two branches: beyond the kink a law's rows of dg/dy change their sign. Calls
    // `look` with dg/dy of each mixture of branches, and the rows that it mirrors, until it returns true.
    template <class Look>
    void each_mixture(const MatX& J, const Look& look) const {
        const auto laws = groups();
        const int m = static_cast<int>(laws.size());
        const bool all = m <= most_mixed;
        for (int mixture = 1; mixture < (all ? 1 << m : m + 1); ++mixture) {
            MatX other = J;
            VecX mirrored = VecX::Zero(n);
            for (int i = 0; i < m; ++i) {
                if (all ? !(mixture >> i & 1) : i + 1 != mixture) continue;
                const int first = laws[i].first, count = laws[i].second - first;
                other.middleRows(first, count) *= -1.0;
                mirrored.segment(first, count).setOnes();
            }
            if (look(other, mirrored)) return;
        }
    }

    // Least det(I - dg/dy) over the mixtures of branches.
    double least_determinant(const MatX& J) const {
        const MatX I = MatX::Identity(n, n);
        double least = (I - J).determinant();
        each_mixture(J, [&](const MatX& other, const VecX&) {
            least = std::min(least, (I - other).determinant());
            return false;
        });
        return least;
    }

    // y is the only solution when every mixture of branches contracts, which |dg/dy| tells; else another one is looked
    // for in each mixture that turns the equation over.
    void check_uniqueness(const VecX& y, double size) {
        const MatX I = MatX::Identity(n, n), J = w.scratch.jacobian;
        const double here = (I - J).determinant();
        w.now.determinant = here;
        if (!(here > least_determinant_told)) paradox(std::min(here, 0.0));  // what cannot be told from zero is zero
        const VecX bound = (I - J.cwiseAbs()).partialPivLu().solve(VecX::Ones(n));
        if ((bound.array() > 0.0).all()) return;
        const VecX c = constants();
        each_mixture(J, [&](const MatX& other, const VecX& mirrored) {
            const double there = (I - other).determinant();
            if (there > 0.0) return false;
            const VecX beyond = 2.0 * mirrored.cwiseProduct(c - y);
            if (there == 0.0 || leads_elsewhere(y, y + (I - other).partialPivLu().solve(beyond), size)) paradox(there);
            return false;
        });
    }

    // Whether Newton's method from `start` finds a solution that is not y.
    bool leads_elsewhere(const VecX& y, VecX start, double size) {
        VecX g(n);
        try {
            for (int it = 0; it < newton_limit; ++it) {
                image(start, g);
                const VecX residual = g - start;
                const double scale = std::max({size, start.cwiseAbs().maxCoeff(), g.cwiseAbs().maxCoeff()});
                if (residual.cwiseAbs().maxCoeff() <= same_solution * scale)
                    return (start - y).cwiseAbs().maxCoeff() > other_solution * scale;
                differentiate(start, g, scale);
                start += (MatX::Identity(n, n) - w.scratch.jacobian).partialPivLu().solve(residual);
            }
        } catch (const Failure& failure) {
            if (failure.kind != Failure::Kind::not_finite) throw;
        }
        return false;
    }

    void newton(VecX& y, VecX& g, double size) {
        double last = std::numeric_limits<double>::infinity();
        for (int it = 0; it < newton_limit; ++it) {
            image(y, g);
            const VecX residual = g - y;
            size = std::max({size, y.cwiseAbs().maxCoeff(), g.cwiseAbs().maxCoeff()});
            const double error = residual.cwiseAbs().maxCoeff();
            if (!g.allFinite()) throw Failure(Failure::Kind::not_finite, t);
            if (error <= newton_tolerance * size || (it > 3 && error <= stalled * size && error >= last)) {
                differentiate(y, g, size);
                check_uniqueness(y, size);
                image(y, g);
                return;
            }
            last = error;
            differentiate(y, g, size);
            const VecX step = (MatX::Identity(n, n) - w.scratch.jacobian).partialPivLu().solve(residual);
            if (!step.allFinite()) paradox(0.0);  // exactly between one solution and none
            y += step;
        }
        w.now.determinant = least_determinant(w.scratch.jacobian);
        paradox(w.now.determinant);
    }

    // Fixed-point steps from the solution before; false where they contract slowly.
    bool iterate() {
        VecX &y = w.scratch.unknown, &g = w.scratch.image;
        auto yn = y.head(n);
        double last = 0.0;
        for (int it = 0; it < fixed_point_limit; ++it) {
            image(y, g);
            double size = 0.0, change = 0.0;
            for (int k = 0; k < n; ++k) {
                size = std::max(size, std::abs(g[k]));
                change = std::max(change, std::abs(g[k] - y[k]));
            }
            if (!g.head(n).allFinite()) throw Failure(Failure::Kind::not_finite, t);
            yn = g.head(n);
            if (change <= reaction_tolerance * size) return true;
            if (it > 1 && change > good_contraction * last && change > slow_change * size) return false;
            if (it > 1 && change >= last) return true;  // rounding
            // The next change would be below rounding: the motion just found needs one more pass and no check.
            if (it > 0 && change * (change / last) <= reaction_tolerance * size) {
                set(g);
                motion();
                return true;
            }
            last = change;
        }
        return false;
    }

    // Places of the unknowns among those of all elements and laws, which a warm start keeps.
    template <class Exchange>
    void exchange(const Exchange& swap) const {
        const int elements = static_cast<int>(p.frictions.size());
        int k = 0;
        each_unknown([&](size_t e) { swap(k++, static_cast<int>(e), 1); },
                     [&](const UserLaw& law) { swap(k, elements + law.index * nv(), nv()); k += nv(); });
    }

    void solve() {
        VecX &kept = w.state.unknown, &y = w.scratch.unknown;
        y.setZero();
        if (w.state.warm) exchange([&](int k, int place, int count) { y.segment(k, count) = kept.segment(place, count); });
        w.state.warm = false;  // what a failure leaves is no start for the next evaluation
        if (!iterate()) {
            VecX start = y.head(n), g(n);
            newton(start, g, 0.0);
            y.head(n) = start;
            set(start);
            motion();
        }
        exchange([&](int k, int place, int count) { kept.segment(place, count) = y.segment(k, count); });
    }
};

}  // namespace

// Loads that the ideal motion gives, as the paper's Example (c) takes them; their laws are then known.
static void ideal_loads(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    bool asked = false;
    for (const Friction& f : p.frictions) asked |= f.reaction == Reaction::ideal;
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) { asked |= law.reaction == Reaction::ideal; });
    if (!asked) return;
    const IdealMotion motion(p, w);
    for (size_t e = 0; e < p.frictions.size(); ++e)
        if (p.frictions[e].reaction == Reaction::ideal) update_limit(p, w, e, t, q, v);
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) {
        if (law.reaction == Reaction::ideal) w.now.base_C += ask(p, law, w, t, q, v);
    });
}

void find_known_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    w.now.C_smooth.setZero();
    add_smooth_forces(p, w, t, q, v, w.now.C_smooth);
    for (size_t e = 0; e < p.frictions.size(); ++e)
        if (p.frictions[e].reaction == Reaction::none) update_limit(p, w, e, t, q, v);
    add_slip_forces(p, w, false, w.now.C_smooth);
}

void solve_with_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const VecX& known) {
    w.now.determinant = 1.0;
    if (!p.needs_reactions) {
        w.now.C = known;
        w.scratch.trial = w.now.F + w.now.C;
        solve_acceleration(p, w, w.scratch.trial);
        return;
    }
    w.now.base_C = known;  // C that does not change while the reactions are sought
    ideal_loads(p, w, t, q, v);
    Implicit implicit{p, w, t, q, v};
    if (implicit.n == 0) implicit.motion();
    else implicit.solve();
    w.state.warm = true;
}

}  // namespace pn
