#include "run/events/mode_selection.hpp"

#include <algorithm>

#include "contact/active_set.hpp"
#include "contact/impact.hpp"
#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/law_residuals.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/state_projection.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "friction/problem.hpp"
#include "friction/stick_slip.hpp"
#include "math/tolerances.hpp"
#include "run/events/unloaded_contacts.hpp"

namespace pn {

namespace {

bool has_negligible_speed(const System& system, int e) {
    const double slip = slip_velocity(system.w.now, system.p.frictions[e]).norm();
    return slip <= EventCandidates::parameters.raised_rest_speed * (1.0 + system.v.cwiseAbs().maxCoeff());
}

// Select the modes of all elements at rest together, and project the state. Elements that turn out to move are removed
// from the list.
void resolve_together(System& system, double t, ModeQuery& mode_query, bool strikes) {
    const Program& p = system.p;
    Workspace& w = system.w;
    std::vector<int>& resting = mode_query.at_rest;
    for (;;) {
        resolve_modes(p, w, t, system.q, system.v, mode_query);
        if (!strikes) restore_motion(p, w, t, system.v);
        // Sticking elements get zero slip velocity, without rounding.
        project(p, w, t, system.q, system.v);
        follow_projection(p, w, t, system.q, system.v, resting);
        begin_step(p, w, t, system.q, system.v);
        // Nearly redundant sticking elements can leave a slipping element a velocity that opposes its mode.
        const auto moving = std::stable_partition(resting.begin(), resting.end(), [&](int e) {
            return has_negligible_speed(system, e) || slip_along_mode(p, w, e) >= 0.0;
        });
        if (moving == resting.end()) return;
        std::for_each(moving, resting.end(), [&](int e) { follow_velocity(p, w, e, mode_query); });
        resting.erase(moving, resting.end());
    }
}

// Let elements at their limits stick that sticking elements and constraints hold, because they cannot move. Return true if
// there are any.
bool stick_if_held(System& system, double t, const std::vector<int>& resting) {
    const Program& p = system.p;
    Workspace& w = system.w;
    std::vector<int> slipping;
    for (int e : resting)
        if (slips(w.state.mode[e])) slipping.push_back(e);
    if (slipping.empty() || slipping.size() == resting.size()) return false;
    FrictionProblem problem(p, w, slipping);
    problem.clean(p, w);
    std::vector<Mode> modes = w.state.mode;
    bool changes = false;
    const double noise = relative_acceleration_rounding * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
    for (size_t i = 0, row = 0; i < slipping.size(); row += problem.dims[i++]) {
        if (problem.W.diagonal().segment(row, problem.dims[i]).any()) continue;
        if (slip_acceleration(p, w, p.frictions[slipping[i]]).norm() > noise) continue;
        modes[slipping[i]] = sticking;
        changes = true;
    }
    if (!changes) return false;
    set_modes(p, w, modes);
    begin_step(p, w, t, system.q, system.v);
    if (project_velocity(p, w, t, system.v)) begin_step(p, w, t, system.q, system.v);
    return true;
}

// Check if the sticking elements share their load in several ways. Then one of them is beyond its limit, or the element
// that reached its limit still sticks.
bool shares_load(System& system, double t, const std::vector<int>& resting, int limit_element) {
    const Program& p = system.p;
    Workspace& w = system.w;
    bool shares = false;
    if (!p.needs_reactions && !w.now.rows.redundant) return shares;
    for (int e : resting)
        shares |=
            w.state.mode[e] == sticking &&
            (e == limit_element ||
             !holding_force(p, w, e, t, system.q, system.v).is_within(mode_selection_parameters.limit_rounding));
    return shares;
}

// Request collocation steps if slip in several directions begins from rest. The slip velocity does not define a direction
// yet.
void set_direction_search(System& system, const std::vector<int>& resting, bool sought) {
    const auto begins = [&](int e) { return system.p.frictions[e].dim > 1 && slips(system.w.state.mode[e]); };
    bool& seeks = system.w.state.solves_directions;
    seeks = system.can_solve_directions &&
            ((seeks && sought && has_turning_slip(system)) || std::any_of(resting.begin(), resting.end(), begins));
}

// Defer the sticking of an element that came to rest but must slip on. The deferral ends when the element changes its mode
// or moves.
void linger(RunState& state, const std::vector<Mode>& before, const FoundEvent& event) {
    for (size_t e = 0; e < before.size(); ++e)
        if (before[e] != state.mode[e]) state.is_sticking_deferred[e] = 0;
    const int e = event.index;
    if (event.kind == FoundEvent::Kind::rest_or_limit && slips(before[e]) && before[e] == state.mode[e])
        state.is_sticking_deferred[e] = 1;
}

}  // namespace

bool has_turning_slip(const System& system) {
    const std::vector<int>& slipping = system.w.now.slipping;
    return std::any_of(slipping.begin(), slipping.end(), [&](int e) { return system.p.frictions[e].dim > 1; });
}

Event::Kind kind_of_change(Mode before, Mode after) {
    return after == sticking ? Event::Kind::stick : before == sticking ? Event::Kind::slip : Event::Kind::reverse;
}

namespace {

// Selection of the stick-slip modes of a given active set, with the projected state.
struct FrictionSwitch {
    System& system;
    double t;
    const std::optional<FoundEvent>& event;  // event that causes the switch, if any
    const std::vector<Mode>& before;
    ModeQuery mode_query;
    int held = -1;  // element that has just reached its limit
    std::vector<char> rest;  // contacts at rest, per gap

    // `joint_motion`: onset motion of all contacts, if known.
    void find(const OnsetMotion* joint_motion) {
        const Program& p = system.p;
        Workspace& w = system.w;
        const bool strikes = event && event->kind == FoundEvent::Kind::touch;  // a touch may start sticking elements
        if (p.frictions.empty()) {
            begin_step(p, w, t, system.q, system.v);
            if (!strikes) restore_motion(p, w, t, system.v);
            return keep_on_planes();
        }
        const bool known = event && !event->of_gap();
        mode_query = event && !strikes ? make_mode_query(p, w, system.v, known ? event->index : -1)
                                       : make_first_mode_query(p, w, t, system.q, system.v);
        held = known && before[event->index] == sticking && !is_open(p, w, event->index) ? event->index : -1;
        if (known && event->kind == FoundEvent::Kind::released_together) mode_query.at_limit = mode_query.at_rest;
        else if (held >= 0) mode_query.at_limit = {held};
        if (joint_motion) joint_motion->to_modes(p, w, mode_query);
        resolve_together(system, t, mode_query, strikes);
    }

    // Return the elements that stuck until they reached their limit at this event.
    std::vector<int> at_limit() const {
        std::vector<int> list;
        if (!event || event->of_gap()) return list;
        for (int e = 0; e < system.ne; ++e)
            if (before[e] == sticking && (event->kind == FoundEvent::Kind::released_together || e == event->index))
                list.push_back(e);
        return list;
    }

    // Project closed contacts onto their planes, in position and velocity.
    void keep_on_planes() {
        const std::vector<char>& closed = system.w.state.closed;
        if (std::find(closed.begin(), closed.end(), char(1)) == closed.end()) return;
        project(system.p, system.w, t, system.q, system.v);
        begin_step(system.p, system.w, t, system.q, system.v);
    }
};

// Set the velocity to zero if only rounding error of it is left.
void rest(System& system, double t) {
    system.v.setZero();
    begin_step(system.p, system.w, t, system.q, system.v);
}

// Select the active set of the resting contacts, and the stick-slip modes with it.
void close_and_find(System& system, double t, bool starts, FrictionSwitch& friction) {
    const Program& p = system.p;
    const auto& event = friction.event;
    const bool landing = starts || event->kind == FoundEvent::Kind::touch;
    OnsetQuery query;
    query.rest = system.touching.at(p, system.w, t, system.q, system.v, starts).rest;
    if (event && event->kind == FoundEvent::Kind::lift) query.opening_gap = event->index;
    if (event && !event->of_gap()) query.arrived_element = event->index;
    query.at_limit = friction.at_limit();
    query.after_impact = landing;
    friction.rest = query.rest;
    const VecX q = system.q, v = system.v;
    select_active_contacts(p, system.w, t, q, v, query, [&](const OnsetMotion* joint_motion) {
        system.q = q;
        system.v = v;
        update_kinematics(p, system.w, t, q, v);
        friction.find(joint_motion);
        if (landing && !p.moves_in_time && system.v.cwiseAbs().maxCoeff() <= rest_speed) rest(system, t);
    });
}

}  // namespace

std::vector<Event> changes_since(const System& system, double t, const std::vector<char>& closed,
                                 const std::vector<Mode>& before, int turned) {
    const Program& p = system.p;
    const RunState& now = system.w.state;
    std::vector<Event> changes;
    if (turned < 0 && same_bytes(closed, now.closed) && same_bytes<Mode>(before, now.mode)) return changes;
    for (size_t i = next_difference(closed, now.closed, 0); i < closed.size();
         i = next_difference(closed, now.closed, i + 1))
        changes.push_back({t, closed[i] ? Event::Kind::lift_off : Event::Kind::touch_down, p.gaps[i].block});
    const size_t turning = turned < 0 ? before.size() : static_cast<size_t>(turned);
    for (size_t e = 0; e < before.size(); ++e) {
        const size_t changed = next_difference<Mode>(before, now.mode, e);
        e = turning < e ? changed : std::min(changed, turning);
        if (e == before.size()) break;
        const bool begins = before[e] == unloaded && slips(now.mode[e]);  // a contact that slides as soon as it closes
        if (e == turning || (now.mode[e] != unloaded && !begins))
            changes.push_back({t, kind_of_change(before[e], now.mode[e]), static_cast<int>(e)});
    }
    return changes;
}

// Select new modes as switch_modes does. `laws`: residuals of their motion.
static std::vector<Event> select_modes(System& system, double t, VecX& y, VecX& dy, const std::optional<FoundEvent>& event,
                                       std::vector<int>* released, LawResiduals& laws) {
    const Program& p = system.p;
    Workspace& w = system.w;
    system.read(y);
    system.read_law_states(y);
    const std::vector<Mode> before = w.state.mode;
    const std::vector<char> closed = w.state.closed;
    const std::vector<Vec3> directions = w.state.slip_direction;
    FrictionSwitch friction{system, t, event, before, {}, -1, {}};
    if (p.gaps.empty()) friction.find(nullptr);
    else close_and_find(system, t, !event, friction);
    if (released && event && (event->kind == FoundEvent::Kind::lift || event->in_vain))
        *released = open_unloaded_contacts(system, t);
    if (!p.frictions.empty() || !p.gaps.empty()) {
        const std::vector<int>& resting = friction.mode_query.at_rest;
        const bool are_held = stick_if_held(system, t, resting);
        set_direction_search(system, resting, event.has_value());
        system.write(y);
        w.state.is_hyperstatic = are_held || shares_load(system, t, resting, friction.held);
    }
    MotionState state;
    for (int i = 0; i < static_cast<int>(friction.rest.size()); ++i)
        if (friction.rest[i] && !w.state.closed[i]) state.open.push_back(i);
    system.read(y);
    laws = check_laws(p, w, t, system.q, system.v, state);
    system.rate_of_evaluation(t, y, dy);
    if (!event) return {};
    linger(w.state, before, *event);
    const int e = event->of_gap() ? -1 : event->index;
    const bool turned = e >= 0 && before[e] == 1 && w.state.mode[e] == 1 && p.frictions[e].dim > 1 &&
                        directions[e].dot(w.state.slip_direction[e]) < 0.0;
    return changes_since(system, t, closed, before, turned ? e : -1);
}

std::vector<Event> switch_modes(System& system, double t, VecX& y, VecX& dy, const std::optional<FoundEvent>& event,
                                std::vector<int>* released) {
    Workspace& w = system.w;
    const VecX at_event = y;
    const RunState before = w.state;
    LawResiduals laws;
    const std::vector<Event> changes = select_modes(system, t, y, dy, event, released, laws);
    if (laws.are_small()) return changes;
    // Select all modes from the velocities, as at the start of a run: from the velocities before the projection, then
    // from those after it.
    const VecX projected = y;
    for (const VecX* from : {&at_event, &projected}) {
        if (!event && from == &at_event) continue;
        y = *from;
        if (released) released->clear();
        set_contacts(system.p, w, before.closed, before.mode);
        w.state = before;
        select_modes(system, t, y, dy, std::nullopt, nullptr, laws);
        if (laws.are_small()) return event ? changes_since(system, t, before.closed, before.mode) : std::vector<Event>();
    }
    throw laws.failure(t);
}

bool contacts_strike(System& system, double t, const VecX& y, bool starts) {
    system.read(y);
    return system.touching.at(system.p, system.w, t, system.q, system.v, starts).strikes;
}

bool contacts_land(System& system, double t, const VecX& y) {
    if (system.p.gaps.empty()) return false;
    system.read(y);
    return system.touching.at(system.p, system.w, t, system.q, system.v, false).lands;
}

Strike strike_contacts(System& system, double t, VecX& y, bool starts, bool bounces) {
    const Program& p = system.p;
    const std::vector<char> closed = system.w.state.closed;
    const std::vector<Mode> modes = system.w.state.mode;
    system.read(y);
    const std::vector<char>& touch = system.touching.at(p, system.w, t, system.q, system.v, starts).touch;
    const Impact impact = resolve_impact(p, system.w, t, system.q, system.v, touch, bounces);
    system.write(y);
    set_closed(p, system.w, closed);  // the modes after the impact are selected later
    set_modes(p, system.w, modes);
    Strike out;
    double largest = 0.0;
    for (const Vec3& impulse : impact.impulse) largest = std::max(largest, impulse.norm());
    for (size_t i = 0; i < impact.gaps.size(); ++i) {
        out.work += impact.work[i];
        if (!(impact.impulse[i].norm() > impulse_rounding * largest)) continue;
        out.events.push_back({t, Event::Kind::impact, p.gaps[impact.gaps[i]].block, impact.impulse[i], impact.work[i],
                              impact.v_minus, impact.v_plus});
    }
    out.work_of_constraints = impact.energy_change - out.work;
    return out;
}

void remember_directions(System& system, std::vector<double>& slip, int stopped_element) {
    Workspace& w = system.w;
    const auto velocity = [&](int e) { return slip_velocity(w.now, system.p.frictions[e]); };
    const double min_speed = stopped_element < 0 ? mode_selection_parameters.directed_slip
                                         : std::max(mode_selection_parameters.directed_slip,
                                                    velocity(stopped_element).norm());
    for (int e : w.now.loaded_elements) {
        const Friction& f = system.p.frictions[e];
        if (w.state.is_sticking_deferred[e] && !has_negligible_speed(system, e)) w.state.is_sticking_deferred[e] = 0;
        if (!slips(w.state.mode[e]) || f.dim == 1) continue;
        const Vec3 u = velocity(e);
        slip[e] = u.norm();
        const Vec3& n = w.state.last_direction[e];
        if (w.state.solves_directions) w.state.slip_direction[e] = n;
        else if (slip[e] > min_speed) w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
    }
}

}  // namespace pn
