#include "run/torque_schedule.hpp"

#include <algorithm>
#include <cmath>
#include <variant>

#include "dynamics/step_start.hpp"

namespace pn {

double whole_lengths(double time, double length) {
    return std::floor(time / length * (1.0 + Torques::parameters.quotient_rounding) + Torques::parameters.count_rounding);
}

Torques::Torques(System& system, Progress& progress, const Options& options, Output& output, Breaks& breaks)
    : p(system.p), w(system.w), system_(system), progress_(progress), options_(options), output_(output),
      breaks_(breaks) {}

void Torques::sample() {
    const auto* sampled = std::get_if<SampledTorque>(&p.actuation);
    if (!sampled || w.now.has_override) return;
    if (w.state.has_held && progress_.t < options_.t0 + progress_.next_period * sampled->period) return;
    system_.read(progress_.y);
    sampled->function(progress_.t, system_.q, system_.v, w.state.held_torque);
    w.state.has_held = true;
    progress_.next_period = static_cast<long>(whole_lengths(progress_.t - options_.t0, sampled->period)) + 1;
    recompute_rate();
}

bool Torques::call_callback() {
    system_.read(progress_.y);
    const Options::CallbackResult result = options_.callback(progress_.t, system_.q, system_.v, w.scratch.work);
    if (result != Options::CallbackResult::torque) return result == Options::CallbackResult::proceed;
    set(w.scratch.work);
    return true;
}

void Torques::set(const VecX& torque) {
    w.now.has_override = true;
    w.now.override_torque = torque;
    system_.read(progress_.y);
    recompute_rate();
}

// Recompute the rate at the state that was read last.
void Torques::recompute_rate() {
    begin_step(p, w, progress_.t, system_.q, system_.v);
    system_.rate_of_evaluation(progress_.t, progress_.y, progress_.rate);
    output_.configured_now();
}

double Torques::next_stop(double after, double t_end) const {
    double stop = std::min(t_end, breaks_.next(after));
    const auto* sampled = std::get_if<SampledTorque>(&p.actuation);
    if (sampled && !w.now.has_override)  // nothing is sampled while other torques replace the actuation
        stop = std::min(stop, options_.t0 + progress_.next_period * sampled->period);
    if (const TorqueTable* table = p.torque_table()) {
        const auto next = std::upper_bound(table->times.begin(), table->times.end(), after);
        if (next != table->times.end()) stop = std::min(stop, *next);
    }
    return stop;
}

}  // namespace pn
