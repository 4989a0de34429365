#include "contact/resting_problem.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/cone/uniqueness.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

// Coefficient of a contact, or limit of another element.
double strength(const Friction& f) { return f.gap >= 0 ? f.mu : f.constant; }

}  // namespace

bool is_at_rest(const Program& p, const Workspace& w, const VecX& v, const OnsetQuery& query,
                const RunState& before, int e) {
    const bool known = before.mode[e] == sticking || before.is_sticking_deferred[e];
    return e == query.arrived_element || (known && !query.after_impact) ||
           slip_velocity(w.now, p.frictions[e]).norm() <= rest_speed * (1.0 + v.cwiseAbs().maxCoeff());
}

bool OnsetMotion::slides() const {
    return std::any_of(modes.begin(), modes.end(), [](Mode mode) { return slips(mode); });
}

void OnsetMotion::to_modes(const Program& p, Workspace& w, ModeQuery& query) const {
    if (is_initial_guess) {
        query.nearby_friction = friction;
        if (several) return;  // the modes are not unique
        query.nearby_modes = modes;
        query.nearby_directions = direction;
        return;
    }
    for (int e : query.at_rest) {
        query.modes[e] = modes[e];
        if (p.frictions[e].dim > 1 && slips(modes[e]))
            w.state.slip_direction[e] = w.state.last_direction[e] = direction[e];
    }
    query.is_solved_jointly = true;
    query.several = several;
    query.several_element = several_element;
}

RestingProblem::RestingProblem(const Program& program, Workspace& workspace, const VecX& velocity,
                               const std::vector<int>& gaps, const std::vector<int>& others,
                               const OnsetQuery& onset_query, const RunState& state)
    : p(program), w(workspace), v(velocity), query(onset_query), before(state),
      rows(program, workspace, gaps, true, others) {
    const int all = static_cast<int>(rows.W.rows());
    int n = 0;
    MatX share = MatX::Zero(all, all);
    drag = share;
    for (size_t i = 0; i < gaps.size(); ++i) {
        const int e = p.gaps[gaps[i]].sliding, at = rows.first[i], dim = rows.cones[i].dim;
        const bool slips = e >= 0 && dim > 1 && !is_at_rest(p, w, v, query, before, e);
        slides.push_back(slips);
        first.push_back(n);
        share(at, n) = 1.0;
        if (slips) {
            const Vec3 u = slip_velocity(w.now, p.frictions[e]);
            const double mu = p.frictions[e].kinetic_limit(p.frictions[e].mu, u.norm());
            for (int k = 1; k < dim; ++k) drag(at + k, n) = -mu * u[k - 1] / u.norm();
            cones.push_back(ConeElement::contact(1, 0.0));
        } else {
            for (int k = 1; k < dim; ++k) share(at + k, n + k) = 1.0;
            cones.push_back(ConeElement::contact(dim, e < 0 ? 0.0 : limit(e)));
        }
        n += cones.back().dim;
    }
    for (size_t i = gaps.size(); i < rows.cones.size(); ++i) {
        const int dim = rows.cones[i].dim;
        first.push_back(n);
        for (int k = 0; k < dim; ++k) share(rows.first[i] + k, n + k) = 1.0;
        cones.push_back(ConeElement::box(dim, limit(rows.element(i))));
        n += dim;
    }
    const VecX free = accelerations();
    W = chosen(rows.W * share.leftCols(n));
    dragging = chosen(rows.W * drag.leftCols(n));
    w0 = chosen(free);
    f.setZero(n);
}

bool RestingProblem::has_one_motion() const {
    const auto is_plain = [&](int e) { return e < 0 || p.frictions[e].static_ratio == 1.0; };
    for (size_t i = 0; i < cones.size(); ++i)
        if (!is_plain(rows.element(i)) || (head(i) && slides[i])) return false;
    return pn::has_one_motion(W, cones);
}

// Select the rows of the problem from all rows.
MatX RestingProblem::chosen(const MatX& of_all) const {
    const int n = cones.empty() ? 0 : first.back() + cones.back().dim;
    MatX out(n, of_all.cols());
    for (size_t i = 0; i < cones.size(); ++i)
        out.middleRows(first[i], cones[i].dim) = of_all.middleRows(rows.first[i], cones[i].dim);
    return out;
}

double RestingProblem::limit(int e) const {
    const std::vector<int>& list = query.at_limit;
    const bool breaks = std::find(list.begin(), list.end(), e) != list.end();
    return p.frictions[e].holding_limit(strength(p.frictions[e])) * (breaks ? 1.0 - parameters.at_limit_reduction : 1.0);
}

// Accelerations of the rows without contact forces.
VecX RestingProblem::accelerations() {
    VecX out = VecX::Zero(rows.W.rows());
    rows.each_row([&](int row, int block, int k) {
        multiply(p.blocks[block], w.now.A, w.now.a, w.scratch.r);
        out[row] = w.scratch.r[p.blocks[block].row + k] + w.now.values[block].bias[p.blocks[block].kept[k]];
    });
    return out;
}

double RestingProblem::acceleration_scale() const {
    return w0.cwiseAbs().maxCoeff() + (W.cwiseAbs() * f.cwiseAbs()).maxCoeff();
}

double RestingProblem::acceleration_scale(int row, int count) const {
    if (count == 0) return 0.0;
    return w0.segment(row, count).cwiseAbs().maxCoeff() +
           (W.middleRows(row, count).cwiseAbs() * f.cwiseAbs()).maxCoeff();
}

double RestingProblem::rounding(int row, int count) const {
    return parameters.rounding * acceleration_scale(row, count) + parameters.common_slip_rounding * acceleration_scale();
}

// Check if friction is at its limit. A contact that shares a load may have a load of rounding only.
bool RestingProblem::at_its_limit(size_t i) const {
    const double most = cones[i].bound * (head(i) ? f[first[i]] : 1.0),
                 rounding = parameters.rounding * f.cwiseAbs().maxCoeff();
    return tail_of(f, i).norm() >= most * (1.0 - parameters.limit_rounding) - rounding;
}

// Set the kinetic limit of contacts that slip from rest. Return true if any limit changed.
bool RestingProblem::release() {
    const VecX a = w0 + W * f;
    bool any = false;
    for (size_t i = 0; i < cones.size(); ++i) {
        const int e = rows.element(i);
        if (tail(i) == 0 || e < 0 || !at_its_limit(i)) continue;
        const double kinetic = p.frictions[e].kinetic_limit(strength(p.frictions[e]), 0.0);
        if (!(tail_of(a, i).norm() > slip_rounding(i)) || !(kinetic < cones[i].bound)) continue;
        cones[i].bound = kinetic;
        any = true;
    }
    return any;
}

bool RestingProblem::solve(bool& shared) {
    const MatX plain = W;
    const VecX free = w0;
    W += dragging;
    if (!solve_cones(false, shared)) return false;
    if (!shared || dragging.isZero(0.0)) return true;
    const MatX coupled = W;
    const VecX shared_forces = f;
    W = plain;
    if (alternate(free)) return true;
    W = coupled;
    w0 = free;
    f = shared_forces;
    return true;
}

bool RestingProblem::moves() const {
    const VecX a = w0 + W * f;
    for (size_t i = 0; i < cones.size(); ++i)
        if ((head(i) && std::abs(a[first[i]]) > rounding(first[i], 1)) ||
            tail_of(a, i).norm() > slip_rounding(i))
            return true;
    return false;
}

bool RestingProblem::hold(ConeComplementarity& solver) {
    if (std::find(slides.begin(), slides.end(), char(1)) != slides.end()) return false;
    VecX holding(f.size());
    if (!solver.hold(W, w0, cones, holding)) return false;
    f = holding;
    return true;
}

bool RestingProblem::solve_cones(bool warm, bool& shared) {
    ConeComplementarity solver;
    for (int round = 0; round < parameters.max_releases; ++round) {
        const bool solved = solver.solve(W, w0, cones, warm || round > 0, f) == ConeStatus::solved;
        if (round == 0 && !warm && (!solved || moves())) {
            const bool another =
                solved && (w0 + W * f).cwiseAbs().maxCoeff() > parameters.min_other_motion * acceleration_scale();
            if (hold(solver)) {
                several = another;
                break;
            }
        }
        if (!solved) return false;
        if (!warm && solver.replace_reversed(f)) several = true;
        if (!release()) break;
    }
    shared = !solver.unique_shares();
    return true;
}

// Alternate between the friction of sliding contacts under the current loads and the contact forces under this friction.
// Return false without convergence.
bool RestingProblem::alternate(const VecX& free) {
    bool shared = false;
    for (int turn = 0; turn < parameters.max_load_iterations; ++turn) {
        const VecX before = f;
        w0 = free + dragging * before;
        if (!solve_cones(true, shared)) return false;
        if ((dragging * (f - before)).cwiseAbs().maxCoeff() <= parameters.load_tolerance * acceleration_scale())
            return true;
    }
    return false;
}

void RestingProblem::read(OnsetMotion& out) const {
    const VecX a = w0 + W * f;
    for (size_t i = 0; i < cones.size(); ++i) {
        const int e = rows.element(i);
        if (i < rows.gaps.size()) {
            const int gap = rows.gaps[i];
            out.closed[gap] = a[first[i]] <= parameters.rounding * acceleration_scale();
            if (e < 0 || !out.closed[gap]) continue;
            if (slides[i]) {
                const Vec3 u = slip_velocity(w.now, p.frictions[e]);
                out.modes[e] = p.frictions[e].dim > 1 || u[0] > 0.0 ? slip_plus : slip_minus;
                out.direction[e] = (1.0 / u.norm()) * u;
                continue;
            }
        }
        out.modes[e] = sticking;
        const VecX friction = tail_of(f, i), slip = tail_of(a, i);
        for (int k = 0; k < tail(i); ++k) out.friction[e][k] = friction[k];
        if (tail(i) == 0 || !at_its_limit(i) || !(slip.norm() > slip_rounding(i))) continue;
        // At a slow slip onset the force defines the direction more accurately than the acceleration.
        const bool by_force = friction.norm() > parameters.rounding * f.cwiseAbs().maxCoeff();
        const VecX direction = by_force ? VecX(-friction.normalized()) : VecX(slip.normalized());
        for (int k = 0; k < slip.size(); ++k) out.direction[e][k] = direction[k];
        out.modes[e] = p.frictions[e].dim > 1 || direction[0] > 0.0 ? slip_plus : slip_minus;
    }
}

}  // namespace pn
