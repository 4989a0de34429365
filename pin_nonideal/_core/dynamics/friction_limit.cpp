#include "dynamics/friction_limit.hpp"

#include <algorithm>

#include "dynamics/reactions.hpp"
#include "dynamics/acceleration.hpp"
#include "math/tolerances.hpp"

namespace pn {

Vec3 slip_velocity(const Evaluation& now, const Friction& f) {
    const RowValues& values = now.values[f.block];
    Vec3 u = Vec3::Zero();
    for (int k = 0; k < f.dim; ++k) u[k] = values.rate[k];
    return u;
}

Vec3 bearing_axis(const Terms& terms, const Friction& f) {
    return f.axis_dof >= 0 ? terms.J[f.axis_dof].ang : terms.body[f.joint].R * f.axis;
}

static PN_INLINE LoadVectors vectors_of_load(const Program& p, Workspace& w, const Friction& f) {
    using Load = Friction::Load;
    const Vec3 none = Vec3::Zero();
    if (f.load == Load::none || f.load == Load::user) return {none, none, none};
    if (f.load == Load::multiplier) {
        const double share = p.described.share(f.row, reactions(p, w).lam);
        return {f.mu * share * Vec3::UnitX(), none, none};
    }
    Force r;
    Vec3 axis;
    if (f.joint > 0) {
        r = joint_wrench(p, w, f.joint);
        axis = bearing_axis(w.now.terms, f);
    } else {
        r = anchor_wrench(p, w, f.anchor);
        const Frame& frame = *frames(p.blocks[f.anchor].kind).first;
        axis = w.now.terms.body[frame.joint].R * (frame.R * f.axis);
    }
    return BearingLoad(f, axis, r).vectors;
}

LoadVectors load_vectors(const Program& p, Workspace& w, const Friction& f) { return vectors_of_load(p, w, f); }

SlipLimits load_limits(const Program& p, Workspace& w, const Friction& f, double t, const VecX& q, const VecX& v) {
    if (f.load == Friction::Load::user) return f.user_limit(p, t, q, v, w);
    double limit = f.constant;
    if (f.load == Friction::Load::none) return limit;
    // Stages past the opening of a contact have a tensile normal force. Friction changes sign with this force.
    if (f.gap >= 0) return limit + f.mu * p.described.share(f.row, reactions(p, w).lam);
    for (const Vec3& vector : vectors_of_load(p, w, f)) limit += vector.norm();
    return limit;
}

double slip_along_mode(const Program& p, const Workspace& w, int e) {
    const Friction& f = p.frictions[e];
    const Vec3 u = slip_velocity(w.now, f);
    return f.dim == 1 ? w.state.mode[e] * u[0] : u.dot(w.state.slip_direction[e]);
}

Vec3 slip_acceleration(const Program& p, Workspace& w, const Friction& f) {
    const Block& block = p.blocks[f.block];
    Vec3 rate = Vec3::Zero();
    if (block.dof >= 0) {
        for (int k = 0; k < f.dim; ++k) rate[k] = w.now.a[block.dof + k];
        return rate;
    }
    multiply(block, w.now.A, w.now.a, w.scratch.r);
    for (int k = 0; k < f.dim; ++k) rate[k] = w.scratch.r[block.row + k] - w.now.b[block.row + k];
    return rate;
}

double slip_rate_along_mode(const Program& p, Workspace& w, int e) {
    const Friction& f = p.frictions[e];
    const Vec3 rate = slip_acceleration(p, w, f);
    return f.dim == 1 ? w.state.mode[e] * rate[0] : rate.dot(w.state.slip_direction[e]);
}

std::pair<double, double> slip_toward_rest(const Program& p, Workspace& w, int e) {
    const Friction& f = p.frictions[e];
    const double along = slip_along_mode(p, w, e);
    if (f.dim == 1) return {along, slip_rate_along_mode(p, w, e)};
    const Vec3 u = slip_velocity(w.now, f);
    const double size = u.norm();
    // Slip too slow to have a direction uses the stored direction.
    const bool slow = size <= min_directed_speed * (1.0 + w.now.speed);
    if (slow || 2.0 * along * along > size * size) return {along, slip_rate_along_mode(p, w, e)};
    return {size, slip_acceleration(p, w, f).dot(u) / size};
}

double limit_under(const Program& p, const Workspace& w, int e, double load) {
    const Friction& f = p.frictions[e];
    const bool slips = f.varies_with_speed() && w.state.mode[e] != sticking;
    return f.kinetic_limit(load, slips ? slip_velocity(w.now, f).norm() : 0.0);
}

void update_limit(const Program& p, Workspace& w, int e, double t, const VecX& q, const VecX& v) {
    w.now.load[e] = load_limits(p, w, p.frictions[e], t, q, v);
    w.now.limit[e] = limit_under(p, w, e, w.now.load[e].against(w.state.mode[e]));
}

SlipLimits static_limits(const Program& p, Workspace& w, int e, double t, const VecX& q, const VecX& v) {
    const Friction& f = p.frictions[e];
    if (f.reaction == Reaction::total) w.now.load[e] = load_limits(p, w, f, t, q, v);
    return w.now.load[e] * f.static_ratio;
}

Vec3 friction_force(const Program& p, Workspace& w, int e) {
    const Friction& f = p.frictions[e];
    if (w.state.mode[e] != sticking) return w.now.slip_force[e];
    Vec3 force = Vec3::Zero();
    const Block& block = p.blocks[f.block];
    if (is_locked(w, block))
        for (int k = 0; k < f.dim; ++k) force[k] = holding_forces(p, w)[block.dof + k];
    else
        for (int k = 0; k < f.dim; ++k) force[k] = w.now.lam[block.row + k];
    return force;
}

HoldingForce holding_force(const Program& p, Workspace& w, int e, double t, const VecX& q, const VecX& v) {
    const SlipLimits limits = static_limits(p, w, e, t, q, v);
    HoldingForce out{friction_force(p, w, e), limits.reach()};
    if (p.frictions[e].dim == 1) out.force[0] -= limits.middle();
    return out;
}

bool shares_hold(const Program& p, Workspace& w, const std::vector<int>& list, double t, const VecX& q, const VecX& v) {
    const Reactions& shared = reactions(p, w);
    const auto presses = [&](int i) {
        const Block& block = p.blocks[p.gaps[i].block];
        return block.kept.empty() || !(shared.lam[block.row] < 0.0);
    };
    const auto holds = [&](int e) {
        if (w.state.mode[e] != sticking) return true;
        const Friction& friction = p.frictions[e];
        const Block& block = p.blocks[friction.block];
        if (is_locked(w, block) || static_cast<int>(block.kept.size()) != friction.dim) return false;
        const SlipLimits limits = static_limits(p, w, e, t, q, v);
        const auto force = shared.lam.segment(block.row, friction.dim);
        return (friction.dim == 1 ? std::abs(force[0] - limits.middle()) : force.norm()) <= limits.reach();
    };
    const std::vector<int>& closed = w.now.closed_gaps;
    return shared.loads_are_feasible && std::all_of(closed.begin(), closed.end(), presses) &&
           std::all_of(list.begin(), list.end(), holds);
}

double current_limit(const Program& p, Workspace& w, int e, double t, const VecX& q, const VecX& v) {
    if (w.state.mode[e] == unloaded) return 0.0;
    if (w.state.mode[e] != sticking) return w.now.limit[e];
    const SlipLimits limits = static_limits(p, w, e, t, q, v);
    return limits.bounding(p.frictions[e].dim == 1 ? friction_force(p, w, e)[0] : 0.0);
}

void reset_slip_directions(Workspace& w) {
    std::fill(w.state.slip_direction.begin(), w.state.slip_direction.end(), Vec3::Zero());
}

Vec3 force_direction(const Program& p, Workspace& w, int e) {
    const Friction& f = p.frictions[e];
    if (f.dim == 1) return Vec3(-w.state.mode[e], 0.0, 0.0);
    if (w.state.solves_directions) return -w.state.last_direction[e];
    const Vec3 u = slip_velocity(w.now, f);
    const double speed = u.norm();
    if (speed > min_directed_speed * (1.0 + w.now.speed))
        // Past a reversal inside a step the direction stays the same, so that the step integrates a smooth law.
        w.state.last_direction[e] = u.dot(w.state.slip_direction[e]) >= 0.0 ? Vec3(u / speed) : Vec3(-u / speed);
    return -w.state.last_direction[e];
}

void add_current_slip_force(const Program& p, const Workspace& w, int e, VecX& C) {
    const Block& block = p.blocks[p.frictions[e].block];
    const Vec3& force = w.now.slip_force[e];
    if (block.dof >= 0)
        for (int k = 0; k < block.total; ++k) C[block.dof + k] += force[k];
    else
        add_along(block, w.now.A, force, C);
}

void add_slip_force(const Program& p, Workspace& w, int e, VecX& C) {
    if (!slips(w.state.mode[e])) return;
    w.now.slip_force.change(e) = w.now.limit[e] * force_direction(p, w, e);
    w.now.reactions.current = false;
    add_current_slip_force(p, w, e, C);
}

void add_slip_forces(const Program& p, Workspace& w, bool load_dependent, VecX& C) {
    for (int e : w.now.slipping)
        if ((p.frictions[e].reaction != Reaction::none) == load_dependent) add_slip_force(p, w, e, C);
}

}  // namespace pn
