#include "dynamics/unknowns.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/reactions.hpp"
#include "dynamics/acceleration.hpp"

namespace pn {

Unknowns::Unknowns(const Program& program, Workspace& workspace, double time, const VecX& q_, const VecX& v_)
    : p(program), w(workspace), t(time), q(q_), v(v_) {
    each([&](size_t e) { ++n; bearings &= p.frictions[e].load != Friction::Load::user; },
         [&](const UserLaw&) { n += p.mechanism.nv; bearings = false; });
}

std::vector<int> Unknowns::elements() const {
    std::vector<int> list;
    each([&](size_t e) { list.push_back(static_cast<int>(e)); }, [](const UserLaw&) {});
    return list;
}

void Unknowns::set(const VecX& y) {
    const int nv = p.mechanism.nv;
    int k = 0;
    each([&](size_t e) { w.now.limit[e] = y[k++]; },
         [&](const UserLaw& law) { w.now.user_C[law.index] = y.segment(k, nv); k += nv; });
}

void Unknowns::motion() {
    w.now.C = w.now.base_C;
    add_slip_forces(p, w, true, w.now.C);
    each([](size_t) {}, [&](const UserLaw& law) { w.now.C += w.now.user_C[law.index]; });
    solve_motion(p, w, true);
}

void Unknowns::image(const VecX& y, VecX& g) {
    set(y);
    motion();
    ++w.counters.iterations;
    // Do not evaluate laws, above all user laws, for a diverged stage. Diverged unknowns give no motion.
    if (!std::isfinite(w.now.a.squaredNorm())) {
        const bool has_finite_forces = std::isfinite(w.now.F.squaredNorm() + w.now.base_C.squaredNorm());
        throw Failure(has_finite_forces ? Failure::Kind::not_converged : Failure::Kind::not_finite, t, elements());
    }
    const int nv = p.mechanism.nv;
    int k = 0;
    each([&](size_t e) {
        w.now.load[e] = load_limits(p, w, p.frictions[e], t, q, v);
        g[k++] = limit_under(p, w, static_cast<int>(e), w.now.load[e].against(w.state.mode[e]));
    }, [&](const UserLaw& law) { g.segment(k, nv) = user_law_force(p, law, w, t, q, v); k += nv; });
}

double Unknowns::rounding() const {
    if (!shares_contact_loads(p, w)) return 0.0;
    double factor = 0.0;
    each([&](size_t e) { factor = std::max(factor, limit_under(p, w, static_cast<int>(e), 1.0)); },
         [](const UserLaw&) {});
    return parameters.shared_rounding * factor * reactions(p, w).lam.cwiseAbs().maxCoeff();
}

bool Unknowns::is_motion(const VecX& y) {
    if (p.gaps.empty()) return true;
    const ReleasedZeroLoads free(w);
    VecX g(n);
    image(y, g);
    const double size = g.cwiseAbs().maxCoeff() + y.head(n).cwiseAbs().maxCoeff();
    return (g - y.head(n)).cwiseAbs().maxCoeff() <= parameters.zero_load_set_rounding * size + rounding();
}

void Unknowns::equation(const VecX& y, ReactionEquation& found) {
    constexpr int vectors = std::tuple_size_v<LoadVectors>;
    found.resize(n, vectors * n);
    VecX &shifted = w.scratch.shifted, &g = w.scratch.image;
    image(y, g);
    double size = std::max(y.head(n).cwiseAbs().maxCoeff(), g.head(n).cwiseAbs().maxCoeff());
    if (!(size > 0.0)) size = 1.0;
    // Load vectors of the current motion: at y (column -1), or their differences to the vectors at y, divided by the step.
    const auto read = [&](int column, double step) {
        int i = 0;
        each([&](size_t e) {
            const Friction& f = p.frictions[e];
            const double factor = limit_under(p, w, static_cast<int>(e), 1.0);
            const LoadVectors loads = load_vectors(p, w, f);
            for (int k = 0; k < vectors; ++k) {
                const int at = vectors * i + k;
                const Eigen::Vector3d load = factor * loads[k].eigen();
                if (column < 0) found.offset.col(at) = load;
                else found.columns.block<3, 1>(3 * at, column) = (load - found.offset.col(at)) / step;
            }
            if (column < 0) found.constant[i] = factor * f.constant;
            for (int k = 0; k < vectors; ++k) found.element[vectors * i + k] = i;
            found.directed[vectors * i] = f.gap >= 0;
            ++i;
        }, [](const UserLaw&) {});
    };
    read(-1, 1.0);
    for (int j = 0; j < n; ++j) {
        shifted.head(n) = y.head(n);
        shifted[j] += size;
        set(shifted);
        motion();
        ++w.counters.iterations;
        read(j, size);
    }
    for (int at = 0; at < found.vectors(); ++at)  // shift the origin from y to zero friction
        found.offset.col(at) -= found.columns.middleRows<3>(3 * at) * y.head(n);
}

}  // namespace pn
