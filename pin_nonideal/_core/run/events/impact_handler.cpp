#include "run/events/impact_handler.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/power.hpp"
#include "dynamics/step_start.hpp"
#include "run/events/rebound.hpp"

namespace pn {

ImpactHandler::ImpactHandler(System& system, Progress& progress, GapWatch& watch, const Options& options, Output& output,
                 Recording& out)
    : p(system.p), w(system.w), system_(system), progress_(progress), watch_(watch), options_(options), output_(output),
      out_(out) {}

bool ImpactHandler::resolve_impacts(bool starts) {
    int count = 0;
    while (count < parameters.max_simultaneous_impacts && resolve_one_impact(starts)) ++count;
    return count > 0;
}

bool ImpactHandler::resolve_one_impact(bool starts) {
    if (system_.ng == 0 || !contacts_strike(system_, progress_.t, progress_.y, starts)) return false;
    output_.before_jump();
    const Strike found = strike_contacts(system_, progress_.t, progress_.y, starts);
    for (const Event& event : found.events) out_.events.push_back(event);
    progress_.impact_energy += found.work;
    if (system_.energy && p.moves_in_time) system_.work(progress_.y)[constraint_power] += found.work_of_constraints;
    else progress_.numerical_energy += found.work_of_constraints;
    double size = 0.0;
    for (const Event& event : found.events) size += std::abs(event.energy_change);
    if (!options_.strict || !(found.work > parameters.gain_rounding * size)) return true;
    std::vector<int> blocks;
    for (const Event& event : found.events) blocks.push_back(event.element);
    throw Failure(Failure::Kind::impact_energy, progress_.t, blocks, found.work);
}

void ImpactHandler::end_bouncing(double stop) {
    output_.now();
    output_.configured_now();
    if (options_.output_dt > 0.0) stop = std::min(stop, output_.next());
    VecX y_end = progress_.y, rate_end = progress_.rate;
    const RunState state = w.state;
    const auto restore_start = [&] {
        set_closed(p, w, state.closed);
        w.state = state;
        select_rows(p, w);
        system_.read(progress_.y);
        begin_step(p, w, progress_.t, system_.q, system_.v);
    };
    std::optional<Rest> rest;
    const auto failure = attempt([&] { rest = bounce_to_rest(system_, progress_.t, stop, y_end, rate_end); });
    if (!rest) restore_start();
    if (failure) throw *failure;
    if (!rest) return;
    const double from = progress_.t, impact_energy_from = progress_.impact_energy;
    progress_.t = rest->time;
    progress_.y.swap(y_end);
    progress_.rate = rate_end;
    progress_.impact_energy += rest->work;
    output_.keep_time_step({from, y_end, state.closed, state.mode}, impact_energy_from);
    for (const Event& event : rest->events) out_.events.push_back(event);
    output_.configured_now();
    remember_gaps();
}

void ImpactHandler::remember_gaps(bool whole_step) {
    if (system_.ng == 0) return;
    system_.read(progress_.y);
    if (whole_step) watch_.sample_monitored(progress_.t);
    else watch_.sample_all(progress_.t);
}

}  // namespace pn
