#include "run/events.hpp"

#include <algorithm>

#include "dynamics/projection.hpp"
#include "dynamics/slip.hpp"
#include "dynamics/step_start.hpp"
#include "friction/continuation.hpp"

namespace pn {

namespace {

// Slip below this [rad/s or m/s] has no direction worth keeping.
constexpr double directed_slip = 1e-12;
// Part of its limit by which a sticking element may pass it by rounding.
constexpr double limit_rounding = 1e-9;

// Modes of the elements at rest together, and the state that goes with them; those that turn out to move are taken off
// the list.
void resolve_together(System& system, double t, ModeQuestion& asked) {
    const Program& p = system.p;
    Workspace& w = system.w;
    std::vector<int>& resting = asked.at_rest;
    for (;;) {
        resolve_modes(p, w, t, system.q, system.v, asked);
        // What sticks from now on has no slip velocity at all, not one of rounding.
        project(p, w, t, system.q, system.v);
        begin_step(p, w, t, system.q, system.v);
        // Nearly redundant elements that stuck together leave one that slips a velocity, which may oppose its mode.
        const auto moving = std::stable_partition(resting.begin(), resting.end(), [&](int e) {
            return at_rest(p, w, e, system.v) || slip_along_mode(p, w, e) >= 0.0;
        });
        if (moving == resting.end()) return;
        std::for_each(moving, resting.end(), [&](int e) { follow_velocity(p, w, e, asked); });
        resting.erase(moving, resting.end());
    }
}

// Whether the elements that stick share their load in several ways: one of them is beyond its limit, or the one that
// reached it sticks on.
bool shares_load(System& system, double t, const std::vector<int>& resting, int held) {
    const Program& p = system.p;
    Workspace& w = system.w;
    bool shares = false;
    if (!p.needs_reactions && !w.now.rows.redundant) return shares;
    for (int e : resting)
        shares |= w.state.mode[e] == sticking &&
                  (e == held || friction_force(p, w, e).norm() >
                                    static_limit(p, w, e, t, system.q, system.v) * (1.0 + limit_rounding));
    return shares;
}

// Slip of several directions that begins from rest has no velocity to tell its direction: steps seek it.
void seek_directions(System& system, const std::vector<int>& resting, bool sought) {
    const auto begins = [&](int e) { return system.p.frictions[e].dim > 1 && slips(system.w.state.mode[e]); };
    bool& seeks = system.w.state.seeks_directions;
    seeks = system.seeks_directions &&
            ((seeks && sought && turning(system)) || std::any_of(resting.begin(), resting.end(), begins));
}

}  // namespace

bool turning(const System& system) {
    for (int e = 0; e < system.ne; ++e)
        if (system.p.frictions[e].dim > 1 && slips(system.w.state.mode[e])) return true;
    return false;
}

Event::Kind kind_of_change(Mode before, Mode after) {
    return after == sticking ? Event::Kind::stick : before == sticking ? Event::Kind::slip : Event::Kind::reverse;
}

std::vector<Event> switch_modes(System& system, double t, VecX& y, VecX& dy, const std::optional<FoundEvent>& event) {
    const Program& p = system.p;
    Workspace& w = system.w;
    system.read(y);
    system.read_law_states(y);
    if (p.frictions.empty()) {
        begin_step(p, w, t, system.q, system.v);
        system.rate_of_evaluation(t, y, dy);
        return {};
    }
    const std::vector<Mode> before = w.state.mode;
    const std::vector<Vec3> directions = w.state.slip_direction;
    ModeQuestion asked =
        event ? question(p, w, system.v, event->index) : first_question(p, w, t, system.q, system.v);
    const int held = event && before[event->index] == sticking ? event->index : -1;
    if (event && event->kind == FoundEvent::Kind::released_together) asked.breaking = asked.at_rest;
    else if (held >= 0) asked.breaking = {held};
    if (!event || !go_on(p, w, t, system.q, system.v, asked, event->index)) resolve_together(system, t, asked);
    seek_directions(system, asked.at_rest, event.has_value());
    system.write(y);
    w.state.indeterminate = shares_load(system, t, asked.at_rest, held);
    system.rate_of_evaluation(t, y, dy);
    std::vector<Event> changes;
    if (!event) return changes;
    for (int e = 0; e < system.ne; ++e) {
        const bool turned = e == event->index && before[e] == 1 && w.state.mode[e] == 1 && p.frictions[e].dim > 1 &&
                            directions[e].dot(w.state.slip_direction[e]) < 0.0;
        if (before[e] != w.state.mode[e] || turned) changes.push_back({t, kind_of_change(before[e], w.state.mode[e]), e});
    }
    return changes;
}

void remember_directions(System& system, std::vector<double>& slip) {
    Workspace& w = system.w;
    for (int e = 0; e < system.ne; ++e) {
        const Friction& f = system.p.frictions[e];
        if (f.dim == 1 || !slips(w.state.mode[e])) continue;
        const Vec3 u = slip_velocity(w.now, f);
        slip[e] = u.norm();
        const Vec3& n = w.state.last_direction[e];
        if (w.state.seeks_directions) w.state.slip_direction[e] = n;
        else if (slip[e] > directed_slip) w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
    }
}

}  // namespace pn
