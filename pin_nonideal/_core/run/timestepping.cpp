// Time stepping at velocity level (Moreau's midpoint rule): with u the slip velocities at the step's end and P the
// percussions, M (v1 - v0) = h (F + C) + A^T P + N^T P_f, A v1 + phi_t = 0, and P_f opposes u within h times its limit.
// First order, and no creep: what sticks has no velocity at all. All elements are solved together in every step.
#include <algorithm>
#include <cmath>
#include <numeric>

#include "dynamics/solution.hpp"
#include "dynamics/step_start.hpp"
#include "friction/cone_program.hpp"
#include "friction/problem.hpp"
#include "run/simulation.hpp"
#include "tree/liegroup.hpp"

namespace pn {

namespace {

constexpr int load_passes = 60;  // of limits that depend on the load
constexpr double load_tolerance = 1e-13;

}  // namespace

void Simulation::moreau_step(double step) {
    const int nq = system.nq, nv = system.nv, n = static_cast<int>(p.frictions.size());
    const Mechanism& m = p.mechanism;
    const double mid = t + 0.5 * step;
    VecX v0 = y.segment(nq, nv), qm(nq), move = 0.5 * step * v0;
    retract(m, y.data(), move.data(), qm.data());
    // The motion without friction of the elements, constraints met at the end of the step.
    set_modes(p, w, std::vector<signed char>(n, unloaded));
    begin_step(p, w, mid, qm, v0);
    for (int i = 0; i < p.constraints; ++i) {
        const Block& block = p.blocks[i];
        for (size_t k = 0; k < block.kept.size(); ++k)
            w.now.b[block.row + k] = -w.now.values[i].rate[block.kept[k]] / step;
    }
    const VecX force = w.now.F + (p.has_laws() ? w.now.C : VecX(VecX::Zero(nv)));
    solve_acceleration(p, w, force);
    const VecX a_free = w.now.a, lam_free = w.now.lam;
    std::vector<int> all(n);
    std::iota(all.begin(), all.end(), 0);
    FrictionProblem problem(p, w, all);
    const std::vector<int>& dims = problem.dims;
    problem.alpha0 = problem.along(p, w, a_free);
    for (int e = 0, at = 0; e < n; ++e)
        for (int k = 0; k < dims[e]; ++k, ++at) problem.alpha0[at] += w.now.values[p.frictions[e].block].rate[k] / step;
    VecX f = VecX::Zero(problem.rows), limits(n), met(n);  // met: limits that f was found for
    // Limits for the load of this very step.
    for (int pass = 0; pass < load_passes; ++pass) {
        w.now.a = a_free + problem.response * f;
        w.now.lam = lam_free + problem.multipliers * f;
        for (int e = 0, at = 0; e < n; ++e) {
            w.now.slip_force[e] = Vec3::Zero();
            for (int k = 0; k < dims[e]; ++k) w.now.slip_force[e][k] = f[at++];
        }
        w.now.renew();
        double change = 0.0, size = 0.0;
        for (int e = 0; e < n; ++e) {
            const Friction& friction = p.frictions[e];
            const double speed = slip_velocity(w.now, friction).norm();
            const double limit = load_limit(p, w, friction, mid, w.now.terms.q, v0) *
                                 (speed == 0.0 ? friction.static_ratio : friction.speed_factor(speed));
            change = std::max(change, std::abs(limit - limits[e]));
            size = std::max(size, limit);
            limits[e] = limit;
        }
        if (pass > 0 && (change <= load_tolerance * size || !p.needs_reactions)) break;
        f = friction_program(problem.W, problem.alpha0, dims, limits);
        met = limits;
        if (pass + 1 == load_passes) throw Failure(Failure::Kind::paradox, t, {0}, change);
    }
    const VecX end = problem.alpha0 + problem.W * f;
    std::vector<signed char> modes(n);
    VecX v1 = v0 + step * (a_free + problem.response * f);
    for (int e = 0, at = 0; e < n; at += dims[e], ++e) {
        const bool held = f.segment(at, dims[e]).norm() < met[e] * (1.0 - 1e-12);
        modes[e] = held ? sticking : dims[e] > 1 || end[at] > 0.0 ? 1 : -1;
        if (held)
            if (const auto* d = std::get_if<DofRows>(&p.blocks[p.frictions[e].block].kind))
                for (int k = 0; k < d->count; ++k) v1[d->dof + k] = 0.0;
    }
    set_modes(p, w, modes);
    if (system.energy) {  // work over the step, by the mean velocity
        const VecX mean = 0.5 * (v0 + v1);
        probe_rate_.setZero();
        w.now.lam = lam_free + problem.multipliers * f;
        powers(p, w, mean, probe_rate_.data() + nq + nv + system.nz);
        const int at = nq + nv + system.nz;
        // Where a slip turns inside the step its mean velocity may go with the friction that meets its end: that is
        // work of the scheme, not of friction.
        for (const Friction& friction : p.frictions) {
            double& power = probe_rate_[at + 3 + friction.law];
            if (!(power > 0.0)) continue;
            recorder.moved_energy += step * power;
            power = 0.0;
        }
        y.segment(at, system.nw) += step * probe_rate_.segment(at, system.nw);
    }
    if (system.nz > 0) y.segment(nq + nv, system.nz) += step * w.now.dz;
    move = 0.5 * step * v1;
    retract(m, qm.data(), move.data(), y.data());
    y.segment(nq, nv) = v1;
    ++out.steps;
}

void Simulation::step_in_time(double stop, double dt) {
    sample_control(t);
    double end = std::min({t + dt, stop, next_stop(t)});
    if (o.output_dt > 0.0) end = std::min(end, std::max(next_sample, std::nextafter(t, stop)));
    if (stop - end < 1e-9 * dt) end = stop;
    const std::vector<signed char> before = w.state.mode;
    moreau_step(end - t);
    t = end;
    q_ = y.head(system.nq);
    v_ = y.segment(system.nq, system.nv);
    begin_step(p, w, t, q_, v_);  // factors of the new modes: what sticks must not move as the rest is projected
    settle(t, y, derivative);
    remember_directions();
    recorder.moved_energy += pending_energy;
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
        if (before[e] != w.state.mode[e])
            out.events.push_back({t, w.state.mode[e] == sticking ? Event::Kind::stick
                                      : before[e] == sticking ? Event::Kind::slip : Event::Kind::reverse, e});
    report_pulls(t);
    const bool on_grid = o.output_dt > 0.0 && next_sample <= t + 1e-12 * std::max(1.0, std::abs(t));
    if (on_grid) next_sample = o.t0 + ++samples * o.output_dt;
    if (o.output_dt == 0.0 || on_grid || t >= t_end) emit(t, y, true);
}

}  // namespace pn
