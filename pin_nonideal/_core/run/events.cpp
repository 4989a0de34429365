// What happens at an event of stick and slip: new modes for all elements at rest together, and clusters of events.
#include <algorithm>
#include <cmath>

#include "run/simulation.hpp"

namespace pn {

void Simulation::remember_directions() {
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const Friction& f = p.frictions[e];
        if (f.dim == 1 || !slips(w.state.mode[e])) continue;
        const Vec3 u = slip_velocity(w.now, f);
        slip_at_start[e] = u.norm();
        if (u.norm() > 1e-12) w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
    }
}

// A maintained contact that would have to pull, told once each time it begins.
void Simulation::report_pulls(double at) {
    for (size_t i = 0; i < p.contacts.size(); ++i) {
        const bool pull = static_cast<int>(i) == parting || w.now.lam[p.blocks[p.contacts[i]].row] < 0.0;
        if (pull && !pulls[i]) out.events.push_back({at, Event::Kind::pull, p.contacts[i]});
        pulls[i] = pull;
    }
    parting = -1;
}

// New modes for all elements at rest, found together; `trigger` has just come to rest or reached its limit.
void Simulation::switch_modes(double at, VecX& state, int trigger) {
    q_ = state.head(system.nq);
    v_ = state.segment(system.nq, system.nv);
    if (system.nz > 0) w.state.z = state.segment(system.nq + system.nv, system.nz);
    if (p.frictions.empty()) {
        begin_step(p, w, at, q_, v_);
        system.collect(at, state, derivative);
        return;
    }
    const std::vector<signed char> before = w.state.mode;
    const std::vector<Vec3> directions = w.state.slip_direction;
    ModeQuestion asked = trigger < 0 ? first_question(p, w, at, q_, v_) : question(p, w, v_, trigger);
    if (released_together) asked.breaking = asked.at_rest;
    else if (trigger >= 0 && before[trigger] == sticking) asked.breaking = {trigger};
    released_together = false;
    for (;;) {
        resolve_modes(p, w, at, q_, v_, asked);
        // What sticks from now on has no slip velocity at all, not one of rounding.
        project(p, w, at, q_, v_);
        begin_step(p, w, at, q_, v_);
        // Nearly redundant elements that stuck together leave one that slips a velocity, which may oppose its mode.
        std::vector<int>& candidates = asked.at_rest;
        const auto moving = std::stable_partition(candidates.begin(), candidates.end(), [&](int e) {
            return at_rest(p, w, e, v_) || speed_along(e) >= 0.0;
        });
        if (moving == candidates.end()) break;
        std::for_each(moving, candidates.end(), [&](int e) { follow_velocity(p, w, e, asked); });
        candidates.erase(moving, candidates.end());
    }
    state.head(system.nq) = q_;
    state.segment(system.nq, system.nv) = v_;
    w.state.indeterminate = false;
    for (int e : asked.at_rest)
        if (w.state.mode[e] == sticking && ((e == trigger && before[e] == sticking) ||
            friction_force(p, w, e).norm() > static_limit(p, w, e, at, q_, v_) * (1.0 + 1e-9)))
            w.state.indeterminate = true;
    system.collect(at, state, derivative);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const bool turned = e == trigger && before[e] == 1 && w.state.mode[e] == 1 && p.frictions[e].dim > 1 &&
                            directions[e].dot(w.state.slip_direction[e]) < 0.0;
        if (trigger < 0 || (before[e] == w.state.mode[e] && !turned)) continue;
        const auto kind = w.state.mode[e] == sticking ? Event::Kind::stick
                          : before[e] == sticking ? Event::Kind::slip : Event::Kind::reverse;
        out.events.push_back({at, kind, e});
        recent_events.push_back(at);
    }
    if (trigger < 0) return;
    if (before == static_cast<const std::vector<signed char>&>(w.state.mode)) recent_events.push_back(at);
    bridge_cluster(at, state, trigger);
}

// Events that come too thick are bridged by time stepping, which needs none.
void Simulation::bridge_cluster(double at, VecX& state, int element) {
    if (recent_events.size() > chatter_events) recent_events.erase(recent_events.begin());
    if (recent_events.size() < chatter_events || at - recent_events.front() > chatter_time) return;
    recent_events.clear();
    out.events.push_back({at, Event::Kind::chatter, element});
    y = state;
    t = at;
    const double stop = std::min(t_end, at + chatter_time);
    while (t < stop) step_in_time(stop, chatter_time / chatter_steps);
    state = y;
    switch_modes(t, state, -1);
    y = state;
}

}  // namespace pn
