// The structured bindings below name every member of their type. A new member does not compile until it is added here.
#include "run/output/checkpoint.hpp"

#include <algorithm>

#include "dynamics/evaluation.hpp"
#include "dynamics/step_start.hpp"
#include "math/tolerances.hpp"
#include "run/output/archive.hpp"

namespace pn {

static void fields(Archive& a, Counters& x) {
    auto& [evaluations, factorizations, projections, iterations, motion, signorini, coulomb, dissipation] = x;
    a(evaluations, factorizations, projections, iterations, motion, signorini, coulomb, dissipation);
}

void fields(Archive& a, Modes& x) {
    a(x.values_);
    for (Mode mode : x) a.require(slips(mode) || mode == sticking || mode == unloaded);
}

static void fields(Archive& a, Force& x) {
    auto& [lin, ang] = x;
    a(lin, ang);
}

static void fields(Archive& a, VelocityRates& x) {
    auto& [rate, count] = x;
    for (VecX& each : rate) a(each);
    a(count);
    a.require(count >= 0 && count <= VelocityRates::most);
}

static void fields(Archive& a, RunState& x) {
    auto& [mode, closed, slip_direction, last_direction, is_sticking_deferred, solves_directions, is_hyperstatic,
           rank_tolerance, z, held_torque, has_held, unknown, warm, bearing_wrench, has_wrenches, percussion, last_rates,
           q_without_rest, third_order_gap, has_ideal_row_choice, unique, spectral_bound, steps_since] = x;
    a(mode, closed, slip_direction, last_direction, is_sticking_deferred, solves_directions, is_hyperstatic,
      rank_tolerance, z, held_torque, has_held, unknown, warm, bearing_wrench, has_wrenches, percussion, third_order_gap,
      has_ideal_row_choice, unique, spectral_bound, steps_since);
    fields(a, last_rates);
    a.sized(q_without_rest);
}

static void fields(Archive& a, RowChoice& x) {
    auto& [active, redundant, longest, longest_chosen, chosen_pivot, chosen_scale] = x;
    a(active, redundant, longest, longest_chosen, chosen_pivot, chosen_scale);
}

static void fields(Archive& a, TravelState& x) {
    auto& [body, joint, turn, scene, lever, slid_until, placed, slid, turned, body_step, joint_step, turn_step, slid_step,
           turned_step, scene_step, max_total, max_step, summed] = x;
    a(body, joint, turn, scene, lever, slid_until, placed, slid, turned, body_step, joint_step, turn_step, slid_step,
      turned_step, scene_step, max_total, max_step, summed);
}

static void fields(Archive& a, GapState& x) {
    auto& [width, rate, separation, monitored, skipped, path_length, turn, distance, travel, group_recheck,
           recheck_travel, current, monitored_gaps, blocked_since, retry_time] = x;
    a(width, rate, separation, monitored, skipped, path_length, turn, distance, group_recheck, recheck_travel, current,
      blocked_since, retry_time);
    fields(a, travel);
    x.list_monitored();
}

static void fields(Archive& a, Progress& x) {
    auto& [t, h, trials, y, rate, configured_t, configured_y, numerical_energy, samples, next_period,
           detected_break, last_break, next_break, recent_event_times, mode_change_times, event_signs, counted_steps,
           counted_from, bridged_time, bridged_end, slip_at_start, in_tension, gaps, forced_switch_time, impact_energy,
           several_motions, stiff_steps, quiet_steps, rounding, next_rounding_check, growth_times, growth_speeds,
           growth_steps, is_stationary, has_forces, turning_steps, may_hand_over, hand_over_time, drive_end,
           drive_length, rest_time, misses_laws] = x;
    a(t, h, trials.last_rejected, trials.detours, y, rate, configured_t, configured_y, numerical_energy, samples,
      next_period, detected_break, last_break, next_break, event_signs, counted_steps, counted_from, bridged_time,
      bridged_end, slip_at_start, in_tension, forced_switch_time, impact_energy, several_motions, stiff_steps,
      quiet_steps, rounding, next_rounding_check, is_stationary, has_forces, turning_steps, may_hand_over, hand_over_time,
      drive_end, drive_length, rest_time, misses_laws);
    fields(a, gaps);
    a.list(recent_event_times);
    a.list(growth_times);
    a.list(growth_speeds);
    a.list(growth_steps);
    a.list(mode_change_times);
}

static void fields(Archive& a, Event& x) {
    auto& [time, kind, element, impulse, energy_change, v_minus, v_plus, miss] = x;
    a(time, kind, element, impulse, energy_change, miss);
    a.sized(v_minus);
    a.sized(v_plus);
}

static void fields(Archive& a, DenseOutput& x) {
    auto& [times, states, step_modes, closed, turning, turning_counts, directions, sought, torque, moved, impacts] = x;
    for (auto* numbers : {&times, &states, &directions, &torque, &moved, &impacts}) a.list(*numbers);
    for (auto* indices : {&turning, &turning_counts}) a.list(*indices);
    a.list(step_modes);
    a.list(closed);
    a.list(sought);
}

static void fields(Archive& a, Recording& x) {
    // `failure` and `error` are omitted, because a failed run has no next step.
    auto& [t, q, v, violation, violation_rate, acceleration, tau, F_ideal, F_nonideal, lam, lam_ideal, energy, power, z,
           law_forces, limits, reactions, contact_forces, modes, closed, events, dense, steps, rejected, limited, rounding,
           failure, error] = x;
    for (auto* samples : {&t, &q, &v, &violation, &violation_rate, &acceleration, &tau, &F_ideal, &F_nonideal, &lam,
                          &lam_ideal, &energy, &power, &z, &law_forces, &limits, &reactions,
                          &contact_forces})
        a.list(*samples);
    a.list(modes);
    a.list(closed);
    a.list(events);
    fields(a, dense);
    a(steps, rejected, limited, rounding);
}

// The choice of independent rows, and the data that tests this choice, are kept from step to step until the choice
// proves wrong.
static void archive(Archive& a, Workspace& w, Progress& progress, Recording& out) {
    RowChoice& choice = w.now.rows;
    a(w.state, w.counters, choice, w.now.dependent_at_start, progress, out);
}

std::string to_bytes(Workspace& w, Progress& progress, Recording& out) {
    Archive a;
    archive(a, w, progress, out);
    a.seal();
    return a.bytes;
}

// Recompute the factors and rows that the last step left. The next step reads no other data of this evaluation before
// its own first evaluation.
static void evaluate_anew(System& system, const Progress& progress) {
    const Program& p = system.p;
    Workspace& w = system.w;
    const RunState state = w.state;
    const RowChoice choice = w.now.rows;
    const Counters counters = w.counters;
    select_rows(p, w);
    static_cast<RowChoice&>(w.now.rows) = choice;
    w.now.rows.scale = choice.chosen_scale;  // of dependent rows; factors rescale the active ones
    system.read(progress.y);
    configure(p, w, progress.t, system.q, system.v);
    if (state.has_ideal_row_choice) {
        const IdealMotion decided(p, w);
    }
    system.read(progress.configured_y);
    configure(p, w, progress.configured_t, system.q, system.v);
    update_kinematics(p, w, progress.configured_t, system.q, system.v);
    if (progress.is_stationary && progress.has_forces) {  // the next step reads its motion
        VecX rate = progress.rate;
        system.evaluate_step_end(progress.t, progress.y, rate, true);
    }
    w.state = state;
    w.counters = counters;
}

void from_bytes(const std::string& bytes, System& system, Progress& progress, Recording& out) {
    Archive a(bytes);
    archive(a, system.w, progress, out);
    a.end();
    system.w.now.set_stretch(progress.last_break, progress.next_break);
    const int elements = static_cast<int>(std::max(system.p.frictions.size(), system.p.blocks.size()));
    for (const Event& e : out.events) {
        const int known = Event::of_drive(e.kind) ? system.nv : elements;
        a.require(static_cast<size_t>(e.kind) < std::size(event_kinds) && e.element >= 0 && e.element < known);
    }
    a.require(progress.samples >= 0 && progress.next_period >= 0);
    const auto failure = attempt([&] { evaluate_anew(system, progress); });
    a.require(!failure);  // no run has been in a state that cannot be evaluated
}

std::string state_layout() {
    const size_t sizes[] = {sizeof(RunState), sizeof(RowChoice), sizeof(Counters),
                            sizeof(Progress), sizeof(Recording), sizeof(long)};
    std::string layout;
    for (size_t size : sizes) layout += std::to_string(size) + ".";
    return layout;
}

}  // namespace pn
