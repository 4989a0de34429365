// The room that one thread works in.
#include "dynamics/workspace.hpp"

#include <algorithm>

#include "constraints/projection.hpp"
#include "dynamics/evaluation.hpp"

namespace pn {

namespace {

void zero(std::vector<Force>& f) { std::fill(f.begin(), f.end(), Force{Vec3::Zero(), Vec3::Zero()}); }

}  // namespace

Workspace::Workspace(const Program& p) {
    const int nv = p.mechanism.nv, n = static_cast<int>(p.mechanism.joints.size());
    now.terms.allocate(p.mechanism);
    for (VecX* x : {&now.tau, &now.external, &now.F, &now.C, &now.C_smooth, &now.base_C, &now.a, &now.balance, &scratch.scaled, &scratch.scaled_free, &scratch.trial, &scratch.work,
                    &state.held_torque, &now.override_torque})
        *x = VecX::Zero(nv);
    now.values.resize(p.blocks.size());
    for (size_t i = 0; i < p.blocks.size(); ++i) {
        now.values[i].resize(p.blocks[i].total, nv, is_geometric(p.blocks[i].kind));
        now.values[i].constant_A = has_constant_rows(p.blocks[i].kind);
    }
    now.A.assign(p.entries, 0.0);
    now.B.assign(p.entries, 0.0);
    for (VecX* x : {&now.b, &scratch.r, &scratch.miss, &now.lam, &scratch.lam_step, &now.lam_shared}) *x = VecX::Zero(p.layout.rows);
    now.rows.allocate(p.layout, static_cast<int>(p.blocks.size()), nv);
    scratch.ideal_rows = now.rows;
    scratch.ideal_locked.assign(nv, 0);
    now.body_force.resize(n);
    now.reaction_body.resize(n);
    zero(now.body_force);
    zero(now.reaction_body);
    now.motion.assign(n, Motion{Vec3::Zero(), Vec3::Zero()});
    now.momentum.assign(n, Force{Vec3::Zero(), Vec3::Zero()});
    scratch.shift_start = VecX::Zero(p.mechanism.nq);
    scratch.shift = VecX::Zero(p.layout.rows);
    scratch.shift_sum = state.shift_third = scratch.shift;
    scratch.shift_steps.assign(projection_limit, scratch.shift);
    const size_t elements = p.frictions.size();
    state.mode.assign(elements, 1);
    now.limit.assign(elements, 0.0);
    now.load.assign(elements, 0.0);
    state.slip_direction.assign(elements, Vec3::UnitX());
    state.last_direction = state.slip_direction;
    now.slip_force.assign(elements, Vec3::Zero());
    now.user_C.assign(p.user_laws.size(), VecX::Zero(nv));
    state.z = VecX::Zero(p.states);
    now.dz = VecX::Zero(p.states);
    now.law_force.assign(p.law_names.size(), VecX::Zero(nv));
    const size_t unknowns = elements + p.user_laws.size() * nv;
    for (VecX* x : {&state.unknown, &scratch.image, &scratch.newton_step}) *x = VecX::Zero(unknowns);
    want_rows(p, *this);
}

}  // namespace pn
