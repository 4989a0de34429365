#include "run/events/rebound.hpp"

#include <cmath>
#include <limits>

#include "contact/queries.hpp"
#include "contact/impact.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "tree/lie_group.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

constexpr double no_landing = std::numeric_limits<double>::infinity();

struct Bouncing {
    System& system;
    double lowest;

    // Times until the first contact lands from a low flight, until the first contact lands from a higher flight, and
    // until a slip comes to rest (infinite if none). A flight is low if its height is at most `lowest`. `leaves`: time
    // until the last contact in a higher flight has risen above `lowest`.
    struct Next {
        double low = no_landing, high = no_landing, rest = no_landing, leaves = 0.0;
        int element = -1;  // element that comes to rest
        double time() const { return std::min(low, rest); }
        bool stays_low() const { return (low < no_landing || rest < leaves) && high > time(); }
    };
    Next next(double t) const {
        const Program& p = system.p;
        Workspace& w = system.w;
        const double still = rest_rate(system.v);
        Next out;
        for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
            if (w.state.closed[i] || is_bare(p, i)) continue;
            evaluate_gap(p, w, t, system.v, i);
            const double width = gap_width(p, w, i), rate = gap_rate(p, w, i);
            const double fall = -gap_acceleration(p, w, i), rise = std::max(0.0, rate);
            const bool touches = width <= touching_width;
            if (touches && std::abs(rate) <= still && fall <= acceleration_rounding(p, w, i)) continue;
            const double height = touches ? 0.0 : width;  // a touching gap lies on its plane up to rounding
            const double back = landing(height, rate, fall);
            const double most = height + (rise > 0.0 ? 0.5 * rise * rise / fall : 0.0);
            const bool is_low = back < no_landing && most <= lowest;
            double& first = is_low ? out.low : out.high;
            first = std::min(first, back);
            if (!is_low && height <= lowest) out.leaves = std::max(out.leaves, landing(lowest - height, -rate, -fall));
        }
        for (int e = 0; e < system.ne; ++e) {
            if (!slips(w.state.mode[e]) || w.state.is_sticking_deferred[e]) continue;
            const auto [slip, rate] = slip_toward_rest(p, w, e);
            if (!(rate < 0.0) || slip > -rate * out.rest) continue;
            out.rest = std::max(0.0, -slip / rate);
            out.element = e;
        }
        return out;
    }

    // Return the time until a gap of this width and rate closes under the constant acceleration -fall, infinite if it
    // does not.
    static double landing(double width, double rate, double fall) {
        const double square = rate * rate + 2.0 * fall * width;
        if (!(square >= 0.0)) return no_landing;
        const double root = std::sqrt(square);
        if (rate < 0.0) return 2.0 * width / (root - rate);
        return fall > 0.0 ? (rate + root) / fall : no_landing;
    }
};

double energy(const System& system) {
    Terms& terms = system.w.now.terms;
    return kinetic_energy(system.p.mechanism, terms, system.v) + potential_energy(system.p.mechanism, terms);
}

}  // namespace

std::optional<Rest> bounce_to_rest(System& system, double t, double stop, VecX& y, VecX& dy) {
    const Program& p = system.p;
    Workspace& w = system.w;
    system.read(y);
    const RunState before = w.state;
    const Bouncing bouncing{system, rebound_parameters.low_flight * scene_size(p, w)};
    const double before_energy = energy(system), before_work = system.work(y).sum();
    VecX move, from;
    Rest out{t, {}, 0.0};
    int bounce = 0;
    double halves[2] = {0.0, 0.0};
    bool dies_out = true;
    for (; bounce < (dies_out ? 1 : 2) * rebound_parameters.max_bounces; ++bounce) {
        const Bouncing::Next next = bouncing.next(out.time);
        const double time = next.time();
        if (!next.stays_low() || out.time + time >= stop) break;
        from = y;
        const RunState kept = w.state;
        move = time * (system.v + 0.5 * time * w.now.a);
        y += time * dy;
        retract(p.mechanism, system.q.data(), move.data(), y.data());
        out.time += time;
        halves[2 * bounce >= rebound_parameters.max_bounces] += time;
        if (bounce + 1 == rebound_parameters.max_bounces)
            dies_out = halves[1] < rebound_parameters.max_time_ratio * halves[0];
        FoundEvent event{FoundEvent::Kind::touch, 0, out.time};
        if (next.rest < next.low && !contacts_land(system, out.time, y))
            event = {FoundEvent::Kind::rest_or_limit, next.element, out.time};
        else if (contacts_strike(system, out.time, y, false)) strike_contacts(system, out.time, y, false, dies_out);
        switch_modes(system, out.time, y, dy, event);
        system.read(y);
        // If other contacts keep an impact from ending an approach, the same impact would repeat at this instant.
        const double change = (y - from).cwiseAbs().maxCoeff(), rounding = rebound_parameters.state_rounding;
        if (time == 0.0 && change <= rounding * (1.0 + y.cwiseAbs().maxCoeff()) &&
            same_bytes(w.state.closed, kept.closed) && same_bytes<Mode>(w.state.mode, kept.mode))
            break;
    }
    if (bounce == 0) return std::nullopt;
    out.events = changes_since(system, out.time, before.closed, before.mode);
    out.work = energy(system) - before_energy - (system.work(y).sum() - before_work);
    return out;
}

}  // namespace pn
