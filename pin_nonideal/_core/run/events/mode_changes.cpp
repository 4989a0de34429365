#include "run/events/mode_changes.hpp"

#include <algorithm>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

static bool is_of_modes(const Failure& failure) {
    return failure.kind == Failure::Kind::not_converged || failure.kind == Failure::Kind::paradox ||
           failure.kind == Failure::Kind::unmet_law;
}

ModeChanges::ModeChanges(System& system, Progress& progress, const Options& options, Torques& torques, Output& output,
                         ImpactHandler& impacts, TimeStepping& time_stepping, ChatterDetector& chatter, Recording& out)
    : p(system.p),
      w(system.w),
      system_(system),
      progress_(progress),
      options_(options),
      torques_(torques),
      output_(output),
      impacts_(impacts),
      time_stepping_(time_stepping),
      chatter_(chatter),
      out_(out) {}

void ModeChanges::change(FoundEvent event) {
    const RunState before = w.state;
    bool has_impact = false;
    std::vector<int> released;
    event.in_vain = event.kind == FoundEvent::Kind::touch && event.index >= 0 && was_released(event.index);
    const auto failure = attempt([&] {
        if (contacts_land(system_, progress_.t, progress_.y)) event = {FoundEvent::Kind::touch, -1, progress_.t};
        has_impact = event.kind == FoundEvent::Kind::touch && impacts_.resolve_impacts(false);
        for (const Event& found : switch_modes(system_, progress_.t, progress_.y, progress_.rate, event, &released)) {
            out_.events.push_back(found);
            if (!has_impact) chatter_.count();
        }
    });
    if (failure) {
        restore_last(before, has_impact);
        const bool of_hand_over = !has_impact && ((event.of_hand_over && is_of_closed_contacts(*failure)) ||
                                                  is_of_contradicting_contacts(*failure));
        if (!bridge_with_time_stepping(*failure, of_hand_over)) throw *failure;
        return;
    }
    chatter_.remember();
    const bool in_vain = event.kind == FoundEvent::Kind::touch && event.index >= 0 && !has_impact;
    const bool same_modes = std::equal(before.mode.begin(), before.mode.end(), w.state.mode.begin());
    if (!same_modes || before.closed != w.state.closed) progress_.gaps.retry_all();
    else if (in_vain && !w.state.closed[event.index]) progress_.gaps.defer_retry(event.index, progress_.t);
    for (int gap : released) progress_.gaps.defer_retry(gap, progress_.t);
    impacts_.remember_gaps();
    if (has_impact) return end_bouncing();
    if (same_modes) chatter_.count();
    output_.configured_now();
    bridge_chatter(event.of_gap() ? 0 : event.index);
}

// Check if a contact of the same two bodies was opened because no contact of these bodies had a load.
bool ModeChanges::was_released(int gap) const {
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i)
        if (progress_.gaps.is_blocked(i) && same_bodies(p, gap, i)) return true;
    return false;
}

// End the bouncing. If the motion of a low flight is not found, bridge it by time stepping if possible.
void ModeChanges::end_bouncing() {
    const auto failure = attempt([&] { impacts_.end_bouncing(torques_.next_stop(progress_.t, options_.end())); });
    if (failure && !bridge_with_time_stepping(*failure)) throw *failure;
}

// A proof of no motion, or of several motions, is reported to the user.
bool ModeChanges::is_recoverable(const Failure& failure) {
    const bool shown = failure.solutions != Failure::Solutions::unproven;
    return failure.kind == Failure::Kind::step_size || (is_of_modes(failure) && !shown);
}

bool ModeChanges::takes_any_motion(const Failure& failure) const {
    return w.continues && system_.ng > 0 && failure.kind == Failure::Kind::paradox &&
           failure.solutions != Failure::Solutions::none;
}

bool ModeChanges::can_switch_modes(const Failure& failure) const {
    const double spacing = mode_change_parameters.forced_switch_spacing * tiny_step_at(progress_.t);
    return is_of_modes(failure) && options_.method.adaptive() && system_.ng > 0 &&
           progress_.t >= progress_.forced_switch_time + spacing;
}

bool ModeChanges::force_switch() {
    const double t = progress_.t, ahead = tiny_step_at(t);
    const VecX y = progress_.y;
    progress_.y.noalias() += ahead * progress_.rate;
    progress_.t += ahead;
    if (attempt([&] { change(FoundEvent::joint_lift(progress_.t)); })) {
        progress_.t = t;
        progress_.y = y;
        return false;
    }
    progress_.forced_switch_time = progress_.t;
    output_.now();
    return true;
}

bool ModeChanges::contradicts_drive(const Failure& failure) const {
    return failure.kind == Failure::Kind::inconsistent && p.moves_in_time && w.state.sticks_anywhere() &&
           !options_.method.outside();
}

bool ModeChanges::follow_drive() {
    RunState before = w.state;
    const FoundEvent onset{FoundEvent::Kind::touch, -1, progress_.t};
    const auto failure = attempt([&] { switch_modes(system_, progress_.t, progress_.y, progress_.rate, onset); });
    if (failure || std::equal(before.mode.begin(), before.mode.end(), w.state.mode.begin())) {
        restore_modes(before);
        if (!step_with_drive(before)) return false;
    }
    impacts_.remember_gaps();
    for (const Event& change : changes_since(system_, progress_.t, before.closed, before.mode))
        out_.events.push_back(change);
    output_.configured_now();
    output_.now();
    return true;
}

// A motion that starts smoothly has no acceleration at first. Once the speed is above the rounding error of a time step, the
// speed shows which elements slip. `before`: modes after the time steps, which record their own events.
bool ModeChanges::step_with_drive(RunState& before) {
    const double last = progress_.t - progress_.drive_end < progress_.drive_length ? progress_.drive_length : 0.0;
    const double first = options_.method.adaptive() ? mode_change_parameters.drive_step
                                                    : mode_change_parameters.drive_part * options_.dt;
    progress_.drive_length = std::max(2.0 * last, first);
    for (int trial = 0; trial < mode_change_parameters.max_drive_steps; ++trial, progress_.drive_length *= 2.0) {
        const Progress from = progress_;
        const double stop = std::min(options_.end(), progress_.t + progress_.drive_length);
        if (attempt([&] { time_stepping_.step(progress_.drive_length, stop, options_.end()); })) {
            progress_ = from;
            restore_modes(before);
            continue;
        }
        before = w.state;
        progress_.drive_end = progress_.t;
        if (!attempt([&] { switch_modes(system_, progress_.t, progress_.y, progress_.rate, std::nullopt); })) return true;
        restore_modes(before);
    }
    return false;
}

void ModeChanges::restore_modes(const RunState& before) {
    set_contacts(p, w, before.closed, before.mode);
    w.state = before;
}

void ModeChanges::bridge_chatter(int element) {
    if (chatter_.bridge_chatter(element, options_.end())) select_new_modes();
}

// Check if the solver failed, which proves nothing.
bool ModeChanges::is_undecided(const Failure& failure) {
    return failure.kind == Failure::Kind::not_converged || failure.kind == Failure::Kind::unmet_law;
}

bool ModeChanges::is_of_closed_contacts(const Failure& failure) {
    using Kind = Failure::Kind;
    return failure.kind == Kind::closure || failure.kind == Kind::inconsistent || failure.kind == Kind::not_finite ||
           failure.kind == Kind::step_size;
}

bool ModeChanges::is_of_contradicting_contacts(const Failure& failure) const {
    // The failure of contradicting rows has their residual as value, of either sign. The failure of an impact has the
    // value zero.
    return failure.kind == Failure::Kind::inconsistent && failure.value != 0.0 &&
           std::all_of(failure.elements.begin(), failure.elements.end(), [&](int block) { return block >= p.first_gap; });
}

bool ModeChanges::bridge_with_time_stepping(const Failure& failure, bool of_hand_over) {
    const bool takes_any = takes_any_motion(failure);
    if (!of_hand_over && !takes_any && !is_recoverable(failure)) return false;
    if (options_.method.outside() || !(system_.ne > 0 || system_.ng > 0)) return false;
    const bool of_elements = system_.ne > 0 && is_of_modes(failure) && failure.kind != Failure::Kind::unmet_law &&
                             !failure.elements.empty();
    const int element = of_elements ? failure.elements.front() : 0;
    const bool creeps = is_creeping();
    const double spacing = mode_change_parameters.forced_switch_spacing * tiny_step_at(progress_.t);
    if (creeps && p.gaps.empty() && progress_.t > progress_.rest_time + spacing && come_to_rest()) return true;
    if (!(of_hand_over || is_undecided(failure) || takes_any || chatter_.is_zeno() || creeps)) return false;
    bridge(element);
    return true;
}

void ModeChanges::bridge_stalled_steps() {
    const bool bridges = options_.method.adaptive() && !options_.method.outside() && !w.now.closed_gaps.empty();
    if (bridges && chatter_.is_stalled()) bridge(0);
}

// Bridge stretches by time stepping until modes are found. The solver may fail again a little later, or the contacts may
// still contradict each other.
void ModeChanges::bridge(int element) {
    do {
        chatter_.bridge_stretch(element, options_.end());
        const auto again = attempt([&] { select_new_modes(); });
        if (!again) return;
        const bool goes_on = (is_of_modes(*again) && is_recoverable(*again)) || takes_any_motion(*again) ||
                             is_of_contradicting_contacts(*again);
        if (system_.ng == 0 || !goes_on) throw *again;
    } while (progress_.t < options_.end());
}

// Check if all slipping elements are about to rest.
bool ModeChanges::is_creeping() const {
    const double speed = system_.velocity(progress_.y).cwiseAbs().maxCoeff();
    const double max_slip = mode_change_parameters.max_creep_speed * (1.0 + speed);
    const std::vector<int>& slipping = w.now.slipping;
    return !slipping.empty() && std::all_of(slipping.begin(), slipping.end(), [&](int e) {
        return slip_velocity(w.now, p.frictions[e]).norm() <= max_slip;
    });
}

// Let all slipping elements stick where they are, if forces within their limits can hold them.
bool ModeChanges::come_to_rest() {
    const RunState before = w.state;
    const VecX y = progress_.y, rate = progress_.rate;
    const std::vector<int> slipping = w.now.slipping;
    std::vector<Mode> modes = w.state.mode;
    for (int e : slipping) modes[e] = sticking;
    const auto failure = attempt([&] {
        set_modes(p, w, modes);
        system_.read(progress_.y);
        begin_step(p, w, progress_.t, system_.q, system_.v);
        project_velocity(p, w, progress_.t, system_.v);
        system_.write(progress_.y);
        switch_modes(system_, progress_.t, progress_.y, progress_.rate, std::nullopt);
    });
    if (failure || std::any_of(slipping.begin(), slipping.end(), [&](int e) { return slips(w.state.mode[e]); })) {
        progress_.y = y;
        progress_.rate = rate;
        restore_modes(before);
        attempt([&] { evaluate_again(); });
        return false;
    }
    progress_.rest_time = progress_.t;
    for (const Event& change : changes_since(system_, progress_.t, before.closed, before.mode)) {
        out_.events.push_back(change);
        chatter_.count();
    }
    output_.configured_now();
    output_.now();
    return true;
}

void ModeChanges::select_new_modes() {
    switch_modes(system_, progress_.t, progress_.y, progress_.rate, std::nullopt);
    impacts_.remember_gaps();
    output_.configured_now();
}

// Restore the motion before the mode switch that failed, and record it.
void ModeChanges::restore_last(const RunState& before, bool has_impact) {
    restore_modes(before);
    if (has_impact) return;
    attempt([&] {  // if this fails too, the previous sample is the last, and the first failure is reported
        evaluate_again();
        output_.now();
    });
}

void ModeChanges::evaluate_again() {
    system_.read(progress_.y);
    begin_step(p, w, progress_.t, system_.q, system_.v);
    evaluate(p, w, progress_.t, system_.q, system_.v);
}

}  // namespace pn
