// Workspace of one thread.
#include "dynamics/workspace.hpp"

#include <algorithm>
#include <numeric>

#include "math/tolerances.hpp"

namespace pn {

static void size(const Program& p, RunState& state) {
    const size_t elements = p.frictions.size();
    state.mode = Modes(elements);
    state.closed.assign(p.gaps.size(), 0);
    state.slip_direction.assign(elements, Vec3::UnitX());
    state.last_direction = state.slip_direction;
    state.is_sticking_deferred.assign(p.frictions.size(), 0);
    state.z = VecX::Zero(p.states);
    state.held_torque = VecX::Zero(p.mechanism.nv);
    state.unknown = VecX::Zero(p.unknowns());
    if (p.loads_are_of_trees) state.bearing_wrench.resize(p.frictions.size());
    if (!p.gaps.empty() || !p.frictions.empty()) state.percussion = VecX::Zero(p.layout.rows);
    for (VecX& rate : state.last_rates.rate) rate = VecX::Zero(p.mechanism.nv);
    state.third_order_gap = VecX::Zero(p.layout.rows);
}

static void size(const Program& p, Evaluation& now) {
    const int nv = p.mechanism.nv;
    const size_t bodies = p.mechanism.joints.size(), elements = p.frictions.size();
    const Force no_force{Vec3::Zero(), Vec3::Zero()};
    now.terms.allocate(p.mechanism);
    for (VecX* x : {&now.tau, &now.external, &now.F, &now.C, &now.C_smooth, &now.base_C, &now.a, &now.v, &now.holding,
                    &now.override_torque, &now.joint_F, &now.joint_external})
        *x = VecX::Zero(nv);
    now.values.resize(p.blocks, nv);
    now.is_inactive.assign(p.blocks.size(), 0);
    now.selected.assign(p.gaps.size(), 1);
    now.active_blocks.resize(p.blocks.size());
    now.closed_gaps.resize(p.gaps.size());
    std::iota(now.active_blocks.begin(), now.active_blocks.end(), 0);
    std::iota(now.closed_gaps.begin(), now.closed_gaps.end(), 0);
    now.loaded_elements.reserve(elements);
    now.slipping.reserve(elements);
    now.A = RowEntries(p.entries);
    now.B = RowEntries(p.entries);
    for (VecX* x : {&now.b, &now.lam, &now.closing_lam, &now.step_gap, &now.reactions.lam}) *x = VecX::Zero(p.layout.rows);
    now.rows.allocate(p.layout, static_cast<int>(p.blocks.size()), nv);
    now.ideal_rows.allocate(p.layout, static_cast<int>(p.blocks.size()), nv);
    now.body_force.assign(bodies, no_force);
    now.wrench.assign(bodies, no_force);
    now.reactions.body.assign(bodies, no_force);
    now.reactions.momentum.assign(bodies, no_force);
    now.reactions.motion.assign(bodies, Motion{Vec3::Zero(), Vec3::Zero()});
    now.load.assign(elements, SlipLimits());
    now.limit.assign(elements, 0.0);
    now.slip_force.resize(elements);
    now.user_C.assign(p.user_laws, VecX::Zero(nv));
    now.dz = VecX::Zero(p.states);
}

static void size(const Program& p, const Evaluation& now, Scratch& scratch) {
    const int nv = p.mechanism.nv;
    for (VecX* x : {&scratch.scaled, &scratch.scaled_free, &scratch.trial, &scratch.work}) *x = VecX::Zero(nv);
    for (VecX* x : {&scratch.r, &scratch.residual, &scratch.lam_step, &scratch.position_lam})
        *x = VecX::Zero(p.layout.rows);
    scratch.position_start = VecX::Zero(p.mechanism.nq);
    scratch.position_lam_steps.resize(max_projection_iterations);
    scratch.ideal_locked.assign(nv, 0);
    scratch.unknown = scratch.image = scratch.shifted = VecX::Zero(p.unknowns());
    if (p.loads_are_of_trees) scratch.loaded.sweep.resize(p.mechanism);
    scratch.subtree_force = scratch.body_inertia = scratch.body_residual = now.body_force;
    scratch.law_force.resize(p.law_names.size(), nv);
    MotionForces& forces = scratch.forces;
    for (VecX* x : {&forces.given, &forces.magnitude, &scratch.law_weight, &scratch.law_residual, &scratch.law_magnitude})
        *x = VecX::Zero(nv);
    forces.lam = forces.shared_lam = VecX::Zero(p.layout.rows);
    forces.friction.assign(now.slip_force.size(), Vec3::Zero());
    forces.shared_friction = forces.friction;
    forces.limits = now.load;
    forces.is_determined.assign(now.load.size(), 1);
}

Workspace::Workspace(Workspace&&) noexcept = default;
Workspace::~Workspace() = default;

Workspace::Workspace(const Program& p) {
    size(p, state);
    size(p, now);
    size(p, now, scratch);
    set_modes(p, *this, state.mode);
}

static void set_active(const Program& p, Workspace& w, int gap, char closed) {
    w.now.selected[gap] = closed;
    w.now.is_inactive[p.gaps[gap].block] = !closed;
    for (int e : p.gaps[gap].elements) w.now.is_inactive[p.frictions[e].block] = !closed;
}

// Thousands of contacts may be open. Each open contact costs a comparison of bytes.
static void select_contacts(const Program& p, Workspace& w) {
    const std::vector<char>& closed = w.state.closed;
    if (same_bytes(closed, w.now.selected)) return;
    for (int i : w.now.closed_gaps)
        if (!closed[i]) set_active(p, w, i, 0);
    w.now.closed_gaps.clear();
    for (size_t i = next_other(closed, 0, char(0)); i < closed.size(); i = next_other(closed, i + 1, char(0))) {
        w.now.closed_gaps.push_back(static_cast<int>(i));
        if (!w.now.selected[i]) set_active(p, w, static_cast<int>(i), 1);
    }
    const std::vector<char>& inactive = w.now.is_inactive;
    w.now.active_blocks.clear();
    for (size_t i = next_other(inactive, 0, char(1)); i < inactive.size(); i = next_other(inactive, i + 1, char(1)))
        w.now.active_blocks.push_back(static_cast<int>(i));
}

void select_rows(const Program& p, Workspace& w) {
    for (int row : w.now.rows.envelope.row_at) {
        w.now.rows.required[row] = 0;
        w.now.lam[row] = 0.0;  // rows that go out of use keep no force
    }
    std::fill_n(w.now.rows.required.begin(), p.bilateral_rows(), char(1));
    select_contacts(p, w);
    for (int i : w.now.closed_gaps) {
        const Block& block = p.blocks[p.gaps[i].block];
        std::fill_n(w.now.rows.required.begin() + block.row, block.kept.size(), char(1));
    }
    w.now.loaded_elements.clear();
    w.now.slipping.clear();
    std::fill(w.now.terms.locked.begin(), w.now.terms.locked.end(), char(0));
    const std::vector<Mode>& modes = w.state.mode;
    for (size_t e = next_other(modes, 0, unloaded); e < modes.size(); e = next_other(modes, e + 1, unloaded)) {
        const Block& block = p.blocks[p.frictions[e].block];
        w.now.loaded_elements.push_back(static_cast<int>(e));
        if (w.state.mode[e] != sticking) {
            w.now.slipping.push_back(static_cast<int>(e));
            continue;
        }
        // Prescribed motions carry the loads of dofs that they hold. Sticking elements along these dofs have rows too.
        if (block.dof >= 0 && !p.tied_to_drives[block.dof])
            for (int k = 0; k < block.total; ++k) w.now.terms.locked[block.dof + k] = 1;
        else
            for (size_t k = 0; k < block.kept.size(); ++k) w.now.rows.required[block.row + k] = 1;
    }
    w.now.rows.use_required(p.layout, p.blocks, w.now.active_blocks);
    w.state.has_ideal_row_choice = false;
    w.state.rank_tolerance = w.state.sticks_anywhere() ? rank_tolerance_sticking : rank_tolerance;
}

void set_modes(const Program& p, Workspace& w, const std::vector<Mode>& modes) {
    std::vector<Mode>& values = w.state.mode.values_;
    values = modes;
    for (size_t e = next_other(values, 0, unloaded); e < values.size(); e = next_other(values, e + 1, unloaded))
        if (is_open(p, w, static_cast<int>(e))) values[e] = unloaded;
    w.now.slip_force.unload(values);
    w.state.steps_since = undecided_steps;
    w.scratch.factored_unknowns = 0;
    w.now.renew();
    select_rows(p, w);
}

void set_closed(const Program& p, Workspace& w, const std::vector<char>& closed) {
    std::vector<Mode> modes = w.state.mode;
    for (size_t i = 0; i < closed.size(); ++i) {
        if (closed[i] == w.state.closed[i]) continue;
        for (int e : p.gaps[i].elements) modes[e] = unloaded;
    }
    set_contacts(p, w, closed, modes);
}

void set_contacts(const Program& p, Workspace& w, const std::vector<char>& closed, const std::vector<Mode>& modes) {
    for (int i : w.now.closed_gaps) {
        const Block& block = p.blocks[p.gaps[i].block];
        if (!closed[i]) std::fill_n(w.now.lam.data() + block.row, block.kept.size(), 0.0);
    }
    w.state.closed = closed;
    set_modes(p, w, modes);
}

}  // namespace pn
