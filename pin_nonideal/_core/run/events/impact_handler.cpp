#include "run/events/impact_handler.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/power.hpp"
#include "dynamics/step_start.hpp"
#include "run/events/rebound.hpp"

namespace pn {

namespace {

// Energy gain of an impact that counts as rounding, relative to its works.
constexpr double gain_rounding = 1e-12;
// Maximum number of consecutive impacts at one instant. An impact can make other contacts approach again.
constexpr int most_at_once = 100;

}  // namespace

Landing::Landing(System& system, Progress& progress, GapWatch& watch, const Options& options, Output& output,
                 Recording& out)
    : p(system.p), w(system.w), system_(system), now_(progress), watch_(watch), options_(options), output_(output),
      out_(out) {}

bool Landing::strike(bool starts) {
    int count = 0;
    while (count < most_at_once && strike_once(starts)) ++count;
    return count > 0;
}

bool Landing::strike_once(bool starts) {
    if (system_.ng == 0 || !contacts_strike(system_, now_.t, now_.y, starts)) return false;
    output_.before_jump();
    const Strike found = strike_contacts(system_, now_.t, now_.y, starts);
    for (const Event& event : found.events) out_.events.push_back(event);
    now_.impact_energy += found.work;
    if (system_.energy && p.moves_in_time) system_.work(now_.y)[constraint_power] += found.work_of_constraints;
    else now_.moved_energy += found.work_of_constraints;
    double size = 0.0;
    for (const Event& event : found.events) size += std::abs(event.energy_change);
    if (!options_.strict || !(found.work > gain_rounding * size)) return true;
    std::vector<int> blocks;
    for (const Event& event : found.events) blocks.push_back(event.element);
    throw Failure(Failure::Kind::impact_energy, now_.t, blocks, found.work);
}

void Landing::end_bouncing(double stop) {
    output_.now();
    output_.configured_now();
    if (options_.output_dt > 0.0) stop = std::min(stop, output_.next());
    VecX y_end = now_.y, rate_end = now_.rate;
    const RunState state = w.state;
    const auto go_back = [&] {
        set_closed(p, w, state.closed);
        w.state = state;
        select_rows(p, w);
        system_.read(now_.y);
        begin_step(p, w, now_.t, system_.q, system_.v);
    };
    std::optional<Rest> rest;
    try {
        rest = bounce_to_rest(system_, now_.t, stop, y_end, rate_end);
    } catch (const Failure&) {
        go_back();
        throw;
    }
    if (!rest) return go_back();
    now_.t = rest->time;
    now_.y = y_end;
    now_.rate = rate_end;
    now_.impact_energy += rest->work;
    for (const Event& event : rest->events) out_.events.push_back(event);
    output_.configured_now();
    remember_gaps();
}

void Landing::remember_gaps(bool whole_step) {
    if (system_.ng == 0) return;
    system_.read(now_.y);
    if (whole_step) watch_.go_on(now_.t);
    else watch_.look_at_all(now_.t);
}

}  // namespace pn
