#include "friction/modes.hpp"

#include <algorithm>
#include <cmath>

#include "tree/factor.hpp"

namespace pn {

namespace {

constexpr int breaking_passes = 20;       // after these, what reached its limit may stick again
constexpr int outer_limit = 100;          // of limits that depend on the load
constexpr int outer_patience = 6;         // after these, modes that stay the same are tried as they are
constexpr int most_enumerated = 8;        // elements whose combinations of modes are all tried at last
constexpr double limit_tolerance = 1e-12; // relative change of the limits at which the outer iteration ends
constexpr double slack = 1e-9;            // part of the limit by which a mode may miss its condition by rounding
constexpr double least_response = 1e-13;  // part of an element's free response that the constraints must leave it

struct Candidates {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    const std::vector<int>& list;
    std::vector<int> dims;
    int rows = 0;
    double determinant = HUGE_VAL;  // least of the modes in which the reactions have no solution or several

    Candidates(const Program& program, Workspace& ws, double time, const VecX& qq, const VecX& vv,
               const std::vector<int>& elements)
        : p(program), w(ws), t(time), q(qq), v(vv), list(elements) {
        for (int e : list) {
            dims.push_back(p.frictions[e].dim);
            rows += dims.back();
        }
    }

    const Block& block(int e) const { return p.blocks[p.frictions[e].block]; }

    // Slip accelerations of the evaluation at hand.
    VecX accelerations() const {
        VecX alpha(rows);
        int at = 0;
        for (int e : list) {
            const Block& b = block(e);
            multiply(b, w.now.A, w.now.a, w.scratch.r);
            for (size_t k = 0; k < b.kept.size(); ++k) alpha[at++] = w.scratch.r[b.row + k] - w.now.b[b.row + k];
        }
        return alpha;
    }

    // W: slip accelerations per unit of each friction force, after the ideal rows. Exactly zero for what the
    // constraints alone decide, such as the friction of a driven joint.
    MatX responses() {
        MatX W(rows, rows);
        VecX force(p.mechanism.nv), unit = VecX::Zero(p.layout.rows), free(rows);
        const VecX b = w.now.b;
        w.now.b.setZero();
        int column = 0;
        for (int e : list) {
            const Block& from = block(e);
            for (size_t k = 0; k < from.kept.size(); ++k, ++column) {
                force.setZero();
                unit[from.row + k] = 1.0;
                add_transpose(from, w.now.A, unit, force);
                unit[from.row + k] = 0.0;
                solve_motion(p, w, force);
                W.col(column) = accelerations();
                solve_R(p.mechanism, w.now.terms, force);
                free[column] = force.squaredNorm();
            }
        }
        w.now.b = b;
        W = (0.5 * (W + W.transpose())).eval();
        for (int i = 0; i < rows; ++i) {
            if (W(i, i) > least_response * free[i]) continue;
            W.row(i).setZero();
            W.col(i).setZero();
        }
        return W;
    }

    void apply_modes(const std::vector<signed char>& modes) {
        for (size_t i = 0; i < list.size(); ++i) w.state.mode[list[i]] = modes[i];
        want_rows(p, w);
        w.state.warm = false;
        begin_step(p, w, t, q, v);
    }

    // Whether the motion under these modes, loads and all, keeps the conditions that they stand for; the workspace
    // ends evaluated there.
    bool hold(const std::vector<signed char>& modes, int breaking) {
        try {
            for (int e : list) w.now.slip_force[e] = Vec3::Zero();
            apply_modes(modes);
        } catch (const Failure& failure) {
            if (failure.kind != Failure::Kind::paradox) throw;
            determinant = std::min(determinant, failure.value);
            return false;
        }
        if (p.needs_reactions) gather_reactions(p, w);
        const VecX alpha = accelerations();
        const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
        for (size_t i = 0, at = 0; i < list.size(); at += dims[i], ++i) {
            if (modes[i] == sticking) {
                const double limit = static_limit(p, w, list[i], t, q, v);
                const double force = friction_force(p, w, list[i]).norm();
                if (force > limit * (1.0 + slack)) return false;
                const bool breaks = list[i] == breaking || breaking == any_at_limit;
                if (breaks && force >= limit * (1.0 - slack)) return false;
            } else if (dims[i] > 1 || modes[i] * alpha[at] < -slack * size) {
                return false;
            }
        }
        return true;
    }

    // All combinations of modes in turn, those that stick first; true at the first that holds.
    bool enumerate(int breaking) {
        if (rows > most_enumerated || rows != static_cast<int>(list.size())) return false;
        int combinations = 1;
        for (size_t i = 0; i < list.size(); ++i) combinations *= 3;
        std::vector<signed char> modes(list.size());
        for (int combination = 0; combination < combinations; ++combination) {
            for (int i = 0, rest = combination; i < rows; ++i, rest /= 3)
                modes[i] = rest % 3 == 2 ? -1 : static_cast<signed char>(rest % 3);
            if (hold(modes, breaking)) return true;
        }
        return false;
    }

    // Modes that the forces f of the program mean: what is below its limit sticks.
    std::vector<signed char> modes_of(const VecX& f, const VecX& alpha, const VecX& limits, double size,
                                      int breaking) {
        std::vector<signed char> modes(list.size(), sticking);
        for (size_t i = 0, at = 0; i < list.size(); at += dims[i], ++i) {
            const auto fe = f.segment(at, dims[i]);
            const auto ae = alpha.segment(at, dims[i]);
            const bool breaks = (list[i] == breaking || breaking == any_at_limit) && fe.norm() >= limits[i] * (1.0 - slack);
            const bool slides = fe.norm() >= limits[i] * (1.0 - 1e-13) && ae.norm() > 1e-12 * size;
            if (!breaks && !slides) continue;
            const VecX direction = slides ? VecX(ae.normalized()) : VecX(-fe.normalized());
            modes[i] = dims[i] > 1 || direction[0] > 0.0 ? 1 : -1;
            if (dims[i] == 1) continue;
            Vec3& slip = w.state.slip_direction[list[i]];
            slip = Vec3::Zero();
            for (int k = 0; k < dims[i]; ++k) slip[k] = direction[k];
            w.state.last_direction[list[i]] = slip;
        }
        return modes;
    }
};

}  // namespace

Vec3 friction_force(const Program& p, Workspace& w, int e) {
    const Friction& f = p.frictions[e];
    if (w.state.mode[e] != sticking) return w.now.slip_force[e];
    Vec3 force = Vec3::Zero();
    const Block& block = p.blocks[f.block];
    if (const auto* d = std::get_if<DofRows>(&block.kind))
        for (int k = 0; k < f.dim; ++k) force[k] = holding_forces(p, w)[d->dof + k];
    else
        for (int k = 0; k < f.dim; ++k) force[k] = w.now.lam[block.row + k];
    return force;
}

double static_limit(const Program& p, Workspace& w, int e, double t, const VecX& q, const VecX& v) {
    const Friction& f = p.frictions[e];
    if (f.reaction == Reaction::total) w.now.load[e] = load_limit(p, w, f, t, q, v);
    return w.now.load[e] * f.static_ratio;
}

void follow_velocity(const Program& p, Workspace& w, int e) {
    const Vec3 u = slip_velocity(w, p.frictions[e]);
    if (p.frictions[e].dim == 1) {
        w.state.mode[e] = u[0] > 0.0 ? 1 : -1;
    } else {
        w.state.mode[e] = 1;
        w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
    }
}

bool at_rest(const Program& p, const Workspace& w, int e, const VecX& v) {
    if (w.state.mode[e] == sticking) return true;
    return slip_velocity(w, p.frictions[e]).norm() <= rest_speed * (1.0 + v.cwiseAbs().maxCoeff());
}

void resolve_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                   const std::vector<int>& candidates, int breaking) {
    Candidates c(p, w, t, q, v, candidates);
    if (candidates.empty()) {
        want_rows(p, w);
        begin_step(p, w, t, q, v);
        return;
    }
    // Without any friction of the candidates: alpha0, W, and first limits from the load there.
    for (int e : candidates) w.now.slip_force[e] = Vec3::Zero();
    const std::vector<signed char> unloaded_modes(candidates.size(), unloaded);
    c.apply_modes(unloaded_modes);
    const VecX C_smooth = w.now.C_smooth;
    VecX alpha0 = c.accelerations(), limits(candidates.size()), f, push(p.mechanism.nv);
    for (size_t i = 0; i < candidates.size(); ++i) limits[i] = static_limit(p, w, candidates[i], t, q, v);
    const MatX W = c.responses();
    const double noise = 1e-12 * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
    for (int i = 0; i < c.rows; ++i)  // what the constraints hold still has no slip acceleration
        if (W(i, i) == 0.0 && std::abs(alpha0[i]) <= noise) alpha0[i] = 0.0;
    const VecX driven = alpha0;
    std::vector<signed char> modes = unloaded_modes;
    double change = 0.0;
    for (int it = 0; it < outer_limit; ++it) {
        f = friction_program(W, alpha0, c.dims, limits);
        const VecX alpha = alpha0 + W * f;
        const double size = alpha0.cwiseAbs().maxCoeff() + 1e-300;
        const int released = it < breaking_passes ? breaking : -1;
        const auto next = c.modes_of(f, alpha, limits, size, released);
        const bool same = next == modes;
        modes = next;
        if (same && change <= limit_tolerance) break;
        if (same && it >= outer_patience && it % outer_patience == 0) {  // limits that converge slowly
            if (c.hold(modes, released)) return;
            c.apply_modes(unloaded_modes);
        }
        if (it + 1 == outer_limit) {
            if (c.enumerate(released)) return;
            throw Failure(Failure::Kind::paradox, t, candidates, std::min(c.determinant, w.now.determinant));
        }
        // The motion under these forces, and the limits that its loads give: the kinetic one for what slips.
        push.setZero();
        VecX unit = VecX::Zero(p.layout.rows);
        for (size_t i = 0, at = 0; i < candidates.size(); at += c.dims[i], ++i) {
            const Block& from = c.block(candidates[i]);
            for (int k = 0; k < c.dims[i]; ++k) unit[from.row + k] = w.now.slip_force[candidates[i]][k] = f[at + k];
            add_transpose(from, w.now.A, unit, push);
        }
        w.now.C_smooth = C_smooth + push;
        if (p.needs_reactions) {
            solve_reactions(p, w, t, w.now.terms.q, v);
        } else {
            w.now.C = w.now.C_smooth;
            w.scratch.trial = w.now.F + w.now.C;
            solve_motion(p, w, w.scratch.trial);
        }
        alpha0 = c.accelerations() - W * f;
        for (int i = 0; i < c.rows; ++i)
            if (W(i, i) == 0.0) alpha0[i] = driven[i];
        change = 0.0;
        for (size_t i = 0; i < candidates.size(); ++i) {
            const Friction& friction = p.frictions[candidates[i]];
            double limit = static_limit(p, w, candidates[i], t, q, v);
            if (modes[i] != sticking) limit *= speed_factor(friction, 0.0) / friction.static_ratio;
            change = std::max(change, std::abs(limit - limits[i]) / std::max(limit, 1e-300));
            limits[i] = limit;
        }
    }
    for (int e : candidates) w.now.slip_force[e] = Vec3::Zero();
    c.apply_modes(modes);
}

}  // namespace pn
