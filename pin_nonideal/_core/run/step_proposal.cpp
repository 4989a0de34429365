// Proposal of a step: it ends at the next stop, break or hand-over at the latest, and passes those at its start.
#include <algorithm>
#include <utility>

#include "run/simulation.hpp"

namespace pn {

Simulation::Proposal Simulation::propose() {
    if (breaks.reached()) pass_break();
    torques.sample();
    const bool adaptive = options.method.adaptive();
    const std::optional<double> before_hand_over = to_hand_over();
    if (p.searches_breaks) breaks.look(std::min(t_end, progress.t + (adaptive ? progress.h : options.dt)), adaptive);
    double stop = torques.next_stop(progress.t, t_end);
    if (!adaptive)  // stay on the fixed grid, also after an event inside a step
        stop = std::min(stop, options.t0 + (whole_lengths(progress.t - options.t0, options.dt) + 1.0) * options.dt);
    const double remaining = stop - progress.t;
    double size = adaptive ? progress.h : remaining;
    if (adaptive && p.asks_functions && (system.velocity(progress.y).array() == 0.0).all()) {
        const double since = out.events.empty() ? options.t0 : out.events.back().time;
        size = std::min(size, std::max(parameters.rest_step, parameters.rest_part_step * (progress.t - since)));
    }
    bool last = false;
    if (size >= remaining * parameters.whole_way) {
        size = remaining;
        last = true;
    } else if (size > parameters.even_part * remaining) {
        size = parameters.even_part * remaining;
    }
    if (!adaptive && !p.frictions.empty()) {
        const double shorter = locator.shorten_toward_rest(progress.rate, size);
        last &= shorter == size;
        size = shorter;
    }
    if (before_hand_over && *before_hand_over < size) {
        size = *before_hand_over;
        last = false;
    }
    return {size, stop, last};
}

// Steps without error control are searched always. Other steps are searched after a rejection, as a hand-over causes one.
// Contacts of bodies without a load open at once: near a hand-over their rows can turn singular.
std::optional<double> Simulation::to_hand_over() {
    const bool adaptive = options.method.adaptive();
    hand_over_ahead = false;
    if (system.ng == 0 || (adaptive && !progress.may_hand_over)) return std::nullopt;
    bool asks = true;
    for (;;) {
        const double size =
            std::min(adaptive ? progress.h : options.dt, torques.next_stop(progress.t, t_end) - progress.t);
        const std::optional<HandOver::Found> next = hand_over.first(size);
        progress.may_hand_over = next.has_value();
        if (!next || next->time >= size * parameters.whole_way) return std::nullopt;  // passed in the step after a stop
        if (hand_over.is_reached(next->time)) {
            hand_over.pass(next->time);
            progress.hand_over_time = progress.t;
        } else if (!std::exchange(asks, false) || !hand_over.is_unloaded(next->gap)) {
            hand_over_ahead = true;
            return HandOver::step_before(next->time);
        }
        modes.change({FoundEvent::Kind::lift, -1, progress.t, false, true});
        output.now();
    }
}

void Simulation::pass_break() {
    if (!breaks.pass()) return;
    if (system.has_events()) modes.change({FoundEvent::Kind::touch, -1, progress.t});
    output.now();
}

}  // namespace pn
