// A run between two steps as bytes, from which it goes on bit by bit as if it had never stopped. That takes more than
// the state y: the factors that the next projection uses, the guess that the next reaction equation starts from, and
// the modes are all left over from the step before.
//
// The bindings below name every member of their type, so that one added there does not compile until it is added here.
#include "run/archive.hpp"
#include "run/simulation.hpp"

namespace pn {

static void fields(Archive& a, Wrench& x) { a(x.force, x.point, x.couple); }

static void fields(Archive& a, RowValues& x) {
    auto& [rows, geometric, wrench, drift, residual, rate, phi_t, phi_tt, A, constant_A, has_A, b, scratch] = x;
    a(rows, geometric, wrench, drift, residual, rate, phi_t, phi_tt, A, constant_A, has_A, b, scratch);
}

static void fields(Archive& a, Body& x) {
    auto& [R, p, ref, v, acceleration, f, own, Y] = x;
    a(R, p, ref, v, acceleration, f, own, Y);
}

static void fields(Archive& a, Terms& x) {
    // What the pass over the tree holds is found anew in each evaluation.
    auto& [body, J, Ag, nle, M, L, D, inv_sqrt_D, locked, q, pass] = x;
    a(body, J, Ag, nle, M, L, D, inv_sqrt_D, locked, q);
}

static void fields(Archive& a, RowSystem& x) {
    auto& [G, factor, scale, active, wanted, blocks, block_used, orthogonal, redundant, refine, min_pivot, distance, rank,
           Q, tau, work, columns] = x;
    a(G, factor, scale, active, wanted, block_used, orthogonal, redundant, refine, min_pivot, distance, rank, tau, work);
    bool has_Q = Q.cols() > 0;
    a(has_Q);
    if (a.reading()) Q.resize(Q.rows(), has_Q ? scale.size() : 0);
    a(Q);
    a.indices(blocks, static_cast<int>(block_used.size()));
    a.indices(columns, static_cast<int>(active.size()));
}

static void fields(Archive& a, Counters& x) { a(x.evaluations, x.factorizations, x.projections, x.iterations); }

void fields(Archive& a, Modes& x) {
    a(x.values_);
    for (signed char mode : x) a.require(slips(mode) || mode == sticking || mode == unloaded);
}

static void fields(Archive& a, RunState& x) {
    auto& [mode, slip_direction, last_direction, indeterminate, z, held_torque, has_held, unknown, warm, shift_third,
           ideal_decided] = x;
    a(mode, slip_direction, last_direction, indeterminate, z, held_torque, has_held, unknown, warm, shift_third,
      ideal_decided);
}

static void fields(Archive& a, Reactions& x) {
    auto& [current, lam, body, motion, momentum] = x;
    a(current, lam, body, motion, momentum);
}

static void fields(Archive& a, Evaluation& x) {
    auto& [terms, values, A, B, rows, b, lam, tau, external, F, C, C_smooth, base_C, acceleration, reactions, holding,
           has_holding, ideal, limit, load, slip_force, user_C, dz, v, speed, determinant, body_force, override_torque,
           has_override] = x;
    a(terms, values, A, B, rows, b, lam, tau, external, F, C, C_smooth, base_C, acceleration, reactions, holding,
      has_holding, ideal, limit, load, slip_force, user_C, dz, v, speed, determinant, body_force, override_torque,
      has_override);
}

static void fields(Archive& a, Scratch& x) {
    auto& [scaled, scaled_free, trial, work, r, miss, lam_step, ideal_rows, ideal_locked, shift_start, shift, shift_sum,
           shift_steps, scratch_unknown, image, jacobian, subtree_force, law_force] = x;
    a(scaled, scaled_free, trial, work, r, miss, lam_step, ideal_rows, ideal_locked, shift_start, shift, shift_sum,
      shift_steps, scratch_unknown, image, subtree_force, law_force);
    a.matrix(jacobian);
}

static void fields(Archive& a, Workspace& x) { a(x.state, x.now, x.scratch, x.counters); }

static void fields(Archive& a, Event& x) { a(x.time, x.kind, x.element); }

static void fields(Archive& a, Recording& x) {
    // A run that failed or raised has no next step.
    auto& [t, q, v, violation, violation_rate, acceleration, F_ideal, F_nonideal, lam, lam_ideal, energy, power, z, modes,
           events, steps, rejected, failure, error] = x;
    for (auto* samples : {&t, &q, &v, &violation, &violation_rate, &acceleration, &F_ideal, &F_nonideal, &lam, &lam_ideal,
                          &energy, &power, &z})
        a.list(*samples);
    a.list(modes);
    a.list(events);
    a(steps, rejected);
}

void Simulation::archive(Archive& a) {
    // A step leaves nothing in the stepper, nor in the buffers, that the next one reads; `opened` only chooses the
    // words of a failure.
    auto& [p, w, o, out, system, stepper, recorder, t, h, t_end, y, derivative, q_, v_, probe_, probe_rate_, samples, ticks,
           next_save, next_sample, recent_events, slip_at_start, pulls, last_rejected, detours, opened,
           pending_energy, trigger_element, located_element, arrived, parting, released_together, next_period] = *this;
    a(w, out, recorder.moved_energy, t, h, y, derivative, samples, next_sample, slip_at_start, pulls,
      last_rejected, detours, pending_energy, trigger_element, located_element, arrived, released_together, next_period);
    a.list(recent_events);
    const int elements = static_cast<int>(std::max(p.frictions.size(), p.blocks.size()));
    for (const Event& e : out.events)
        a.require(e.kind >= Event::Kind::stick && e.kind <= Event::Kind::chatter && e.element >= 0 && e.element < elements);
}

void Simulation::save() {
    Archive a;
    archive(a);
    o.save(a.bytes);
    next_save = Clock::now() + o.save_interval;
}

void Simulation::restore(const std::string& state) {
    Archive a(state);
    archive(a);
    a.end();
}

}  // namespace pn
