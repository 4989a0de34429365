#include "run/time_stepping/time_stepping.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/acceleration.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/step_start.hpp"
#include "friction/stick_slip.hpp"
#include "run/events/mode_selection.hpp"

namespace pn {

namespace {

// Check if another step from the same state may have another result. Reasons are time, user functions, or steps of
// another method in between.
bool may_differ(const Program& p, const Options& options) {
    return options.method.scheme != Method::Scheme::moreau || p.changes_at_rest() || options.callback ||
           std::holds_alternative<SampledTorque>(p.actuation) || p.torque_table() != nullptr;
}

// Check if accelerations and forces are read at the end of every step, whatever the samples record.
bool reads_forces_always(const Program& p, const Options& options) {
    return options.record.dense || options.callback || !options.events.empty() || !p.contacts.empty() ||
           p.calls_functions || p.has_user_rows;
}

}  // namespace

TimeStepping::TimeStepping(System& system, Progress& progress, GapWatch& watch, const Options& options,
                           Torques& torques, Output& output, Warnings& warnings, ValueEvents& value_events,
                           Recording& out)
    : p(system.p), w(system.w), system_(system), progress_(progress), options_(options), torques_(torques),
      output_(output), warnings_(warnings), value_events_(value_events), out_(out), edges_(system, watch),
      moreau_(system, watch, edges_), is_autonomous_(!may_differ(system.p, options)),
      samples_every_step_(options.method.scheme != Method::Scheme::moreau || options.output_dt == 0.0 ||
                          reads_forces_always(system.p, options)),
      reads_forces_(options.record.evaluates() || reads_forces_always(system.p, options)),
      directions_(options.method.scheme == Method::Scheme::moreau ? System::SlipDirection::of_end
                                                                  : System::SlipDirection::of_step),
      may_lack_motion_(system.ng > 0 || options.method.scheme != Method::Scheme::moreau) {}

// End of a step of this size: at a stop, a jump of the actuation or a due sample before it. Times that differ only by
// rounding count as one end, the latest time.
double TimeStepping::end_of_step(double size, double stop, double t_end) const {
    double end = progress_.t + size;
    bool met = false;
    const auto meet = [&](double time) {
        if (!(time > progress_.t + rounding_) || !(time < end + rounding_)) return;
        end = met && time > end - rounding_ ? std::max(end, time) : time;
        met = true;
    };
    const double jump = torques_.next_stop(progress_.t + rounding_, t_end);
    meet(jump);
    meet(torques_.next_stop(jump, t_end));
    // A sample whose time differs only by rounding is taken at the step's end, which does not move.
    if (options_.output_dt > 0.0 && output_.next() < end - rounding_) meet(output_.next());
    if (stop < end + rounding_) end = stop;
    return end;
}

// Check if accelerations and forces are due at the step's end: at a sample, at the end of the run, or for slip in a scene
// without contacts whose constraints or loads may allow several motions or none: the evaluation finds them.
bool TimeStepping::needs_forces(double end, double t_end) const {
    if (samples_every_step_ || end >= t_end || end >= options_.end() || output_.next() <= end + rounding_)
        return true;
    return system_.ng == 0 && std::any_of(w.now.slipping.begin(), w.now.slipping.end(), [&](int e) {
        return p.frictions[e].dim > 1 || p.frictions[e].reaction != Reaction::none;
    });
}

// Take as much of a step to `end` as approaching edges allow. If an edge passes another edge in this part, half of the
// part is taken instead.
void TimeStepping::step_part(double end, double t_end, double least) {
    const double from = progress_.t, numerical = progress_.numerical_energy, impacts = progress_.impact_energy;
    double h = std::max(edges_.allowed(from, end - from, progress_.y), least);
    y_before_part_ = progress_.y.head(system_.ns);
    before_part_ = w.state.mode;
    closed_before_part_ = w.state.closed;
    for (;; h = std::max(0.5 * h, least)) {
        try_part(h, end, t_end);
        if (h <= least || !edges_.pass(progress_.t, progress_.y)) break;
        progress_.t = from;
        progress_.y.head(system_.ns) = y_before_part_;
        progress_.numerical_energy = numerical;
        progress_.impact_energy = impacts;
        set_contacts(p, w, closed_before_part_, before_part_);
        moreau_.repeat();
    }
    const StepForces::LawMiss& relaxed = moreau_.law_miss();
    if (relaxed.block >= 0 && !progress_.misses_laws) {
        out_.events.push_back({progress_.t, Event::Kind::relaxed, relaxed.block});
        out_.events.back().miss = relaxed.miss;
    }
    progress_.misses_laws = relaxed.block >= 0;
}

// Take a part of length h of a step to `end`, or the whole step if little would be left.
void TimeStepping::try_part(double h, double end, double t_end) {
    double& t = progress_.t;
    const double left = end - t;
    const bool whole = h >= (1.0 - parameters.min_remainder) * left;
    moreau_.step(t, whole ? left : h, progress_.y, progress_.numerical_energy, progress_.impact_energy);
    t = whole ? end : t + h;
    const bool needs_forces_here = progress_.has_forces = whole && needs_forces(end, t_end);
    if (moreau_.project(t, progress_.y, progress_.numerical_energy)) {
        progress_.has_forces = needs_forces_here && reads_forces_;
        if (!progress_.has_forces) return;
        if (directions_ == System::SlipDirection::of_end) follow_slip(p, w, system_.v);
        system_.evaluate_step_end(t, progress_.y, progress_.rate, may_lack_motion_);
        return;
    }
    system_.settle(t, progress_.y, progress_.rate, needs_forces_here, may_lack_motion_, directions_);
    progress_.numerical_energy += system_.numerical_energy;
}

// A step that starts and ends at rest with the same contacts and modes leaves the state unchanged.
void TimeStepping::take(double end, double t_end) {
    const double min_size = parameters.min_cut * (end - progress_.t);
    const double energy_before = progress_.numerical_energy;
    const bool may_stand = is_autonomous_ && (system_.velocity(progress_.y).array() == 0.0).all();
    const bool is_held = may_stand && system_.ng == 0 && is_immobile(p, w);
    if (may_stand) {
        y_from_ = progress_.y.head(system_.ns);
        before_step_ = w.state.mode;
        closed_before_step_ = w.state.closed;
    }
    while (progress_.t < end) step_part(end, t_end, min_size);
    progress_.is_stationary = false;
    if (!may_stand || progress_.misses_laws || !same_bytes<Mode>(before_step_, w.state.mode) ||
        !same_bytes(closed_before_step_, w.state.closed))
        return;
    if (is_held) {
        stay_at_rest();
        progress_.numerical_energy = energy_before;
    }
    progress_.is_stationary = progress_.y.head(system_.ns) == y_from_;
}

// Remove the rounding error from a motion held at rest. Law states continue.
void TimeStepping::stay_at_rest() {
    VecX& y = progress_.y;
    y.head(system_.nq + system_.nv) = y_from_.head(system_.nq + system_.nv);
    system_.work(y) = system_.work(y_from_);
    system_.read(y);
    system_.read_law_states(y);
    begin_step(p, w, progress_.t, system_.q, system_.v);
    system_.rate_of_evaluation(progress_.t, y, progress_.rate);
    progress_.has_forces = true;
}

// Elements at rest take their modes and slip directions from the end of a first step, which costs far less than a solution
// for accelerations.
void TimeStepping::begin(double size) {
    system_.read(progress_.y);
    std::vector<char> closed = system_.touching.at(p, w, progress_.t, system_.q, system_.v, true).rest;
    set_closed(p, w, closed);
    moreau_.reset();
    VecX y = progress_.y;
    double numerical_energy = 0.0, impact_energy = 0.0;
    moreau_.step(progress_.t, size, y, numerical_energy, impact_energy);
    for (size_t i = 0; i < closed.size(); ++i) closed[i] = closed[i] && w.state.closed[i];
    const std::vector<Mode> modes = w.state.mode;
    system_.read(y);
    update_kinematics(p, w, progress_.t + size, system_.q, system_.v);
    follow_slip(p, w, system_.v);
    const std::vector<Vec3> directions = w.state.slip_direction;
    set_closed(p, w, closed);
    system_.read(progress_.y);
    ModeQuery first = make_first_mode_query(p, w, progress_.t, system_.q, system_.v);
    for (int e : first.at_rest) {
        first.modes[e] = modes[e];
        w.state.slip_direction[e] = w.state.last_direction[e] = directions[e];
    }
    set_contacts(p, w, closed, first.modes);
    if (reads_forces_ || !moreau_.is_separate())
        system_.evaluate_step_end(progress_.t, progress_.y, progress_.rate, true);
}

// Add a sample at an event, whose forces are not due otherwise.
void TimeStepping::sample_event() {
    if (!progress_.has_forces && options_.record.evaluates()) {
        system_.read(progress_.y);
        update_kinematics(p, w, progress_.t, system_.q, system_.v);
        if (directions_ == System::SlipDirection::of_end) follow_slip(p, w, system_.v);
        system_.evaluate_step_end(progress_.t, progress_.y, progress_.rate, may_lack_motion_);
        progress_.has_forces = true;
    }
    output_.now();
}

void TimeStepping::step(double size, double stop, double t_end) {
    rounding_ = std::max(parameters.min_remainder * size, same_time(progress_.t));
    torques_.enter(progress_.t + rounding_);
    torques_.sample();
    double& t = progress_.t;
    VecX& y = progress_.y;
    const double end = end_of_step(size, stop, t_end), from = t;
    const bool watched = system_.watches();
    if (watched || !open_before_) {
        before_ = w.state.mode;
        closed_before_ = w.state.closed;
        open_before_ = !watched;
    }
    const VecX y_from = options_.record.dense ? y : VecX();
    const double impact_energy_from = progress_.impact_energy;
    const bool lacks_forces = !progress_.has_forces && reads_forces_ && needs_forces(end, t_end);
    if (!progress_.is_stationary || lacks_forces) take(end, t_end);
    t = end;
    ++out_.steps;
    output_.configured_now();
    remember_directions(system_, progress_.slip_at_start);
    if (watched || system_.watches())
        for (const Event& change : changes_since(system_, t, closed_before_, before_)) out_.events.push_back(change);
    warnings_.check_tension(std::nullopt);
    // The records of a run must not change the events of bridged stretches.
    const bool is_evaluated = progress_.has_forces && options_.method.scheme == Method::Scheme::moreau;
    if (is_evaluated || system_.ng == 0) warnings_.check_uniqueness(false);
    output_.keep_time_step({from, y_from, closed_before_, before_}, impact_energy_from);
    value_events_.sample_end(t, y);
    value_events_.append_events(t, out_.events);
    if (!value_events_.found().empty()) sample_event();
    const bool measures = system_.ng > 0 && output_.is_due(rounding_);
    output_.end_time_step(rounding_, measures ? &moreau_.open_gaps(y) : nullptr);
}

}  // namespace pn
