#include "run/integrators/system.hpp"

#include <algorithm>

#include "contact/depenetration.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/implicit_friction.hpp"
#include "dynamics/power.hpp"
#include "dynamics/state_projection.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "friction/mode_query.hpp"
#include "tree/lie_group.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Maximum force / limit ratio of a contact. A contact whose load jumps to zero has opened.
constexpr double max_load_ratio = 10.0;

System::System(const Program& program, Workspace& workspace, bool with_energy)
    : p(program), w(workspace), energy(with_energy), nq(p.mechanism.nq), nv(p.mechanism.nv), nz(p.states),
      nw(with_energy ? power_count(p) : 0), ne(static_cast<int>(p.frictions.size())),
      ng(static_cast<int>(p.gaps.size())), ns(nq + nv + nz + nw), ny(ns + 2 * ne + ng),
      q(VecX::Zero(nq)), v(VecX::Zero(nv)), q_before_(q) {}

bool System::stands(const VecX& y, const VecX& dy) const {
    const bool in_time = p.changes_at_rest() || p.torque_table() != nullptr;
    return !in_time && (velocity(y).array() == 0.0).all() && (dy.head(ns).array() == 0.0).all();
}

void System::read(const VecX& y) {
    std::copy_n(y.data(), nq, q.data());
    std::copy_n(y.data() + nq, nv, v.data());
}

void System::write(VecX& y) const {
    std::copy_n(q.data(), nq, y.data());
    std::copy_n(v.data(), nv, y.data() + nq);
}

void System::read_law_states(const VecX& y) {
    if (nz > 0) w.state.z = y.segment(nq + nv, nz);
}

void System::derivative(double t, const VecX& y, VecX& dy) {
    read(y);
    read_law_states(y);
    if (on_constraints) pn::project_and_evaluate(p, w, t, q, v);
    else evaluate(p, w, t, q, v);
    if (!w.now.rows.blocks.empty()) smallest_pivot = std::min(smallest_pivot, w.now.rows.distance);
    write_rate(t, dy);
}

void System::rate_of_evaluation(double t, const VecX& y, VecX& dy) {
    read(y);
    write_rate(t, dy);
}

void System::write_rate(double t, VecX& dy, bool locates_events) {
    configuration_rate(p.mechanism, q.data(), v.data(), dy.data());
    std::copy_n(w.now.a.data(), nv, dy.data() + nq);
    if (nz > 0) dy.segment(nq + nv, nz) = w.now.dz;
    if (energy) powers(p, w, v, dy.data() + nq + nv + nz);
    if (!locates_events) return;
    if (!w.now.loaded_elements.empty()) watch(t, dy);
    if (!w.now.closed_gaps.empty()) watch_loads(dy);
}

void System::watch(double t, VecX& dy) {
    std::fill_n(dy.data() + ns, std::min(active() - ns, 2 * ne), 0.0);
    for (int e : w.now.loaded_elements) {
        double *of_element = dy.data() + ns + 2 * e, &share = of_element[0], &rate = of_element[1];
        if (slips(w.state.mode[e])) {
            const auto [speed, change] = slip_toward_rest(p, w, e);
            share = speed;
            rate = change;
        } else if (w.state.mode[e] == sticking && !w.state.is_hyperstatic) {
            const auto [force, limit] = holding_force(p, w, e, t, q, v);
            // The force along one direction keeps its sign: it is smooth through zero.
            share = (p.frictions[e].dim == 1 ? force[0] : force.norm()) / std::max(limit, min_scale);
            if (p.frictions[e].gap >= 0) share = std::clamp(share, -max_load_ratio, max_load_ratio);
        }
    }
}

void System::watch_loads(VecX& dy) {
    double* loads = dy.data() + ns + 2 * ne;
    std::fill_n(loads, ng, 0.0);
    for (int i : w.now.closed_gaps) {
        if (p.blocks[p.gaps[i].block].kept.empty()) continue;
        if (!w.now.rows.redundant) loads[i] = w.now.lam[p.blocks[p.gaps[i].block].row];
        else loads[i] = reactions(p, w).loads_are_feasible ? 1.0 : -1.0;
    }
}

double System::energy_at(const VecX& y) {
    read(y);
    place_bodies(p.mechanism, w.now.terms, q);
    mass_matrix(p.mechanism, w.now.terms);
    return kinetic_energy(p.mechanism, w.now.terms, v) + potential_energy(p.mechanism, w.now.terms);
}

void System::project_and_evaluate(double t, VecX& y, VecX& dy) {
    const double before = energy && !w.now.rows.blocks.empty() ? energy_at(y) : 0.0;
    read(y);
    read_law_states(y);
    bool moved = project_position(p, w, t, q, v);
    moved |= project_onto_dependent(p, w, t, q, v);
    moved |= project_past_sticking(p, w, t, q, v);
    require_closed(p, w, t);
    moved |= begin_step_on_rates(p, w, t, v);
    write(y);
    write_rate(t, dy);
    numerical_energy = 0.0;
    if (!moved || !energy) return;
    numerical_energy =
        kinetic_energy(p.mechanism, w.now.terms, v) + potential_energy(p.mechanism, w.now.terms) - before;
}

// Call `act` at the end of a time step whose modes may allow no motion. If the laws allow no motion, the friction of the
// step determines the motion: always with `may_lack_motion` and without contacts, else only if the solver found no motion
// of contacts, which proves nothing. The friction of a step without contacts satisfies the laws, and holds an element whose
// slip ends in the next step. Return false if the friction of the step determines the motion.
template <class Act>
bool System::attempt_motion(double t, bool may_lack_motion, const Act& act) {
    const auto failure = attempt({Failure::Kind::paradox, Failure::Kind::not_converged, Failure::Kind::inconsistent}, act);
    if (!failure) return true;
    const bool is_inconsistent = failure->kind == Failure::Kind::inconsistent;
    // A prescribed motion may begin at the step's end to move elements that stuck in the step.
    const bool of_drive =
        is_inconsistent && p.moves_in_time && role(p.blocks[failure->elements.front()].kind) == Role::direction;
    if (is_inconsistent && !of_drive) throw *failure;
    const bool satisfied = of_drive || ng == 0 || failure->solutions == Failure::Solutions::unproven;
    if (!(may_lack_motion || satisfied)) throw *failure;
    if (may_lack_motion && !of_drive) {
        w.now.no_motion = true;
        w.now.several_element = failure->elements.empty() ? 0 : failure->elements.front();
    }
    solve_with_step_friction(p, w, t, q, v);
    return false;
}

void System::evaluate_step_end(double t, const VecX& y, VecX& dy, bool may_lack_motion) {
    read(y);
    read_law_states(y);
    w.now.no_motion = false;
    begin_rows(p, w, t, q, v);
    // Closed contacts that others hold apart may contradict each other.
    const bool has_motion = attempt_motion(t, may_lack_motion, [&] {
        assemble_forces(p, w, t, v);
        solve_dynamics(p, w, t, v);
    });
    write_rate(t, dy, has_motion && !may_lack_motion);
}

void System::settle(double t, VecX& y, VecX& dy, bool evaluates, bool may_lack_motion, SlipDirection directions) {
    read(y);
    read_law_states(y);
    numerical_energy = 0.0;
    w.now.no_motion = false;
    if (!evaluates && keeps_to_rows(p, w, t, q, v)) return write(y);
    const auto total = [&] {
        return kinetic_energy(p.mechanism, w.now.terms, v) + potential_energy(p.mechanism, w.now.terms);
    };
    // Factor the rows of the new modes. Sticking elements must not move during the projection.
    configure(p, w, t, q, v);
    const int max_rank = max_rank_near(w);
    const bool undecided = w.now.rows.orthogonal || !w.now.rows.has_rank_up_to(max_rank);
    const bool near = ng == 0 && undecided && !w.state.sticks_anywhere();
    const double before = energy && !w.now.rows.blocks.empty() ? total() : 0.0;
    bool moved = near && choose_rows_near(p, w, t, q, v, max_rank);
    bool chosen = near || configure_step(p, w, max_rank);
    const double longest_single = longest_single_move(p, w);
    if (longest_single > 0.0) q_before_ = q;
    moved |= project_position(p, w, t, q, v, true, !evaluates);
    if (longest_single > 0.0 && left_planes(p, w, longest_single)) {
        q = q_before_;
        chosen = depenetrate(p, w, t, q, v);
        project_position(p, w, t, q, v, true, !evaluates);
        moved = true;
    }
    moved |= project_onto_dependent(p, w, t, q, v);
    const bool past_sticking = project_past_sticking(p, w, t, q, v);
    require_closed(p, w, t);
    if (past_sticking || (moved && evaluates)) chosen = configure_step(p, w);
    moved |= past_sticking;
    const bool has_motion = attempt_motion(t, may_lack_motion, [&] {
        moved |= meet_rates(p, w, t, v);
        if (!evaluates) return;
        if (directions == SlipDirection::of_end) follow_slip(p, w, v);
        continue_step(p, w, t, v, chosen);
    });
    moved |= !has_motion;
    write(y);
    if (evaluates) write_rate(t, dy, has_motion && !may_lack_motion);
    if (moved && energy) numerical_energy = total() - before;
}

bool System::is_on_constraints(double t, const VecX& y) {
    read(y);
    return pn::is_on_constraints(p, w, t, q, v);
}

void System::normalize(VecX& y) const { pn::normalize(p.mechanism, y.data()); }

}  // namespace pn
