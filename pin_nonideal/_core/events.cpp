// Stick and slip along the motion: where an event lies inside a step, and what happens there.
//
// A slipping element watches its slip velocity, a sticking one its multiplier against the static limit, a contact its
// normal force. The
// interpolant gives the first guess of the instant; the step is then taken again up to there and the guess corrected
// by Newton's or the secant method, so that an event is as accurate as a step.
#include <algorithm>
#include <cmath>

#include "simulation.hpp"

namespace pn {

// Slip speed the way that the mode says.
double Simulation::speed_along(int e) const {
    const Friction& f = p.frictions[e];
    const Vec3 u = slip_velocity(w, f);
    return f.dim == 1 ? w.mode[e] * u[0] : u.dot(w.slip_direction[e]);
}

// Positive before the event, zero at it. The workspace must be evaluated at the state.
double Simulation::margin(const Watch& watch, double at, const VecX& state) {
    if (watch.contact >= 0) return w.lam[p.blocks[p.contacts[watch.contact]].row];
    if (watch.slip) return speed_along(watch.element);
    q_ = state.head(system.nq);
    v_ = state.segment(system.nq, system.nv);
    return static_limit(p, w, watch.element, at, q_, v_) * (1.0 + 1e-12) - friction_force(p, w, watch.element).norm();
}

// Fixed steps shrink toward the rest of a slip of several directions, whose direction may turn fast at the end.
double Simulation::toward_rest(double size) {
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const Friction& f = p.frictions[e];
        if (f.dim == 1 || !slips(w.mode[e])) continue;
        const Block& block = p.blocks[f.block];
        q_ = y.head(system.nq);
        v_ = derivative.segment(system.nq, system.nv);
        multiply(block, w.A, v_, w.r);
        const double slip = slip_velocity(w, f).squaredNorm();
        double change = 0.0;
        for (int k = 0; k < f.dim; ++k) {
            const double rate = w.r[block.row + k] - w.b[block.row + k];
            change += rate * rate;
        }
        if (slip < change * size * size) size = std::min(size, std::max(0.5 * std::sqrt(slip / change), 1e-3 * size));
    }
    return size;
}

// What lies past its event at the step's end (the workspace is evaluated there), or may have crossed inside.
std::vector<Simulation::Watch> Simulation::crossed() {
    std::vector<Watch> list;
    if (stepper.method.order > 1)
        for (int i = 0; i < static_cast<int>(p.contacts.size()); ++i)
            if (!pulls[i] && w.lam[p.blocks[p.contacts[i]].row] < 0.0) list.push_back({-1, false, i});
    if (p.frictions.empty()) return list;
    const double t1 = stepper.t0 + stepper.h;
    bool gathered = false;
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const Watch watch{e, w.mode[e] != sticking};
        if (!watch.slip) {
            if (w.indeterminate) continue;
            if (!gathered && p.needs_reactions) gather_reactions(p, w);
            gathered = true;
            bool past = margin(watch, t1, stepper.y1) < 0.0;
            double least = HUGE_VAL, most = 0.0;  // or may have been past it inside, between two stages
            for (int i = 0; i < stepper.method.stages; ++i) {
                const double share = stepper.K[i][system.ny - system.ne + e];
                least = std::min(least, share);
                most = std::max(most, share);
            }
            past |= most + 0.5 * (most - least) > 1.0 + 1e-9 && most - least > 1e-9;
            if (past) list.push_back(watch);
            continue;
        }
        const double speed = stepper.y1.segment(system.nq, system.nv).cwiseAbs().maxCoeff();
        const double noise = 1e-3 * rest_speed * (1.0 + speed);  // of an element that has just begun to slip
        if (p.frictions[e].dim > 1 && !stepper.method.adaptive) {
            const double now = slip_velocity(w, p.frictions[e]).norm();
            if (now < slip_at_start[e] && now <= arrived_speed * (1.0 + speed)) arrived = e;
        }
        if (margin(watch, t1, stepper.y1) < -noise) {
            list.push_back(watch);
            continue;
        }
        // A dip through zero and back: the cubic through both ends and their slopes tells.
        const auto* d = std::get_if<DofRows>(&p.blocks[p.frictions[e].block].kind);
        if (!d || d->count != 1 || stepper.method.order < 2) continue;
        const int i = system.nq + d->dof;
        const double s = w.mode[e], u0 = s * stepper.y0[i], u1 = s * stepper.y1[i];
        const double a0 = s * stepper.h * stepper.K[0][i], a1 = s * stepper.h * stepper.f1[i];
        for (double x : {0.2, 0.4, 0.6, 0.8}) {
            const double z = 1.0 - x;
            const double u = z * z * (1.0 + 2.0 * x) * u0 + x * x * (1.0 + 2.0 * z) * u1 + x * z * (z * a0 - x * a1);
            if (u < -noise) { list.push_back(watch); break; }
        }
    }
    return list;
}

// True when the step now ends at an event; the workspace is evaluated at its end either way.
bool Simulation::locate_event() {
    arrived = parting = -1;
    const std::vector<Watch> watches = crossed();
    if (arrived >= 0) {
        trigger_element = located_element = arrived;
        return true;
    }
    if (watches.empty()) return release_indeterminate();
    const double full = stepper.h, begin = stepper.t0;
    const auto at_fraction = [&](const Watch& watch, double s) {
        stepper.interpolate(s, probe_);
        system.derivative(begin + s * full, probe_, probe_rate_);
        if (!watch.slip && p.needs_reactions) gather_reactions(p, w);
        return margin(watch, begin + s * full, probe_);
    };
    stepper.make_dense();
    // First sign change over the watched elements, on a coarse grid and then by bisection with secants (Illinois).
    double first = 2.0;
    Watch found{-1, false};
    constexpr int grid = 24;
    for (const Watch& watch : watches) {
        double s0 = 0.0, g0 = 1.0;
        bool passed_positive = false;
        for (int k = 1; k <= grid; ++k) {
            const double s1 = static_cast<double>(k) / grid;
            const double g1 = at_fraction(watch, s1);
            if (g1 >= 0.0) {
                s0 = s1;
                g0 = g1;
                passed_positive = true;
                continue;
            }
            double low = s0, high = s1, gl = passed_positive ? g0 : at_fraction(watch, 0.0), gh = g1;
            if (gl <= 0.0) {  // it starts at zero and goes the wrong way at once
                high = 0.0;
            }
            int side = 0;
            for (int it = 0; it < 60 && high - low > 1e-13; ++it) {
                double mid = (low * gh - high * gl) / (gh - gl);
                if (!(mid > low && mid < high)) mid = 0.5 * (low + high);
                const double g = at_fraction(watch, mid);
                if (g == 0.0) { low = high = mid; break; }
                if (g > 0.0) {
                    low = mid; gl = g;
                    if (side == 1) gh *= 0.5;
                    side = 1;
                } else {
                    high = mid; gh = g;
                    if (side == -1) gl *= 0.5;
                    side = -1;
                }
                if (std::abs(g) < 1e-13) break;
            }
            if (high < first) { first = high; found = watch; }
            break;
        }
    }
    if (found.element < 0 && found.contact < 0) {  // the cubic was wrong: nothing crossed
        q_ = stepper.y1.head(system.nq);
        v_ = stepper.y1.segment(system.nq, system.nv);
        if (system.nz > 0) w.z = stepper.y1.segment(system.nq + system.nv, system.nz);
        evaluate(p, w, begin + full, q_, v_);
        return false;
    }
    trigger_element = found.contact < 0 ? found.element : no_trigger;
    located_element = found.element;
    parting = found.contact;
    // Step again up to the event and correct the instant.
    double size = std::clamp(first, 0.0, 1.0) * full, before = 0.0, margin_before = 0.0;
    for (int it = 0; it < 12; ++it) {
        stepper.step(begin, size);
        settle(begin + size, stepper.y1, stepper.f1);
        if (!found.slip && p.needs_reactions) gather_reactions(p, w);
        const double g = margin(found, begin + size, stepper.y1);
        double slope = 0.0;
        if (found.slip && p.frictions[found.element].dim == 1) {
            const Block& block = p.blocks[p.frictions[found.element].block];
            multiply(block, w.A, w.a, w.r);
            slope = w.mode[found.element] * (w.r[block.row] - w.b[block.row]);
        } else if (it == 0) {
            const double d = std::max(1e-6 * full, 1e-12);
            slope = 0.0;
            before = size;
            margin_before = g;
            const double other = std::max(0.0, size - d);
            if (other < size) {
                stepper.step(begin, other);
                settle(begin + other, stepper.y1, stepper.f1);
                if (!found.slip && p.needs_reactions) gather_reactions(p, w);
                slope = (g - margin(found, begin + other, stepper.y1)) / (size - other);
            }
        } else if (size != before) {
            slope = (g - margin_before) / (size - before);
        }
        before = size;
        margin_before = g;
        if (!(std::abs(slope) > 0.0)) break;
        const double next = std::clamp(size - g / slope, 0.0, full);
        if (std::abs(next - size) <= 2e-16 * std::max(std::abs(begin), full) || next == size) break;
        if (it > 3 && std::abs(next - size) < 1e-13 * full) break;
        size = next;
    }
    if (stepper.h != size) {
        stepper.step(begin, size);
        settle(begin + size, stepper.y1, stepper.f1);
    }
    if (found.contact >= 0) return true;
    // Slip of several directions may turn far without coming to rest: then the step just ends here. It has come to
    // rest when hardly anything is left of the slip that the step began with.
    const Friction& f = p.frictions[found.element];
    if (found.slip && f.dim > 1) {
        const double speed = stepper.y1.segment(system.nq, system.nv).cwiseAbs().maxCoeff();
        const double now = slip_velocity(w, f).norm();
        const bool passing = now > rest_part * slip_at_start[found.element] && now > 1e-6 * (1.0 + speed);
        if (passing) trigger_element = no_trigger;
    }
    release_indeterminate();  // which may come earlier
    return true;
}

// Where redundant elements stick together, the multiplier of one says little: they hold as long as some forces within
// all limits do, those of elements included that slip but do not move. Halves the step down to the instant at which
// none do.
bool Simulation::release_indeterminate() {
    if (!w.indeterminate) return false;
    const double full = stepper.h, begin = stepper.t0;
    const std::vector<signed char> modes = w.mode;
    std::vector<int> resting;
    const auto holds = [&](double at) {
        q_ = stepper.y1.head(system.nq);
        v_ = stepper.y1.segment(system.nq, system.nv);
        resting.clear();
        for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
            if (at_rest(p, w, e, v_)) resting.push_back(e);
        resolve_modes(p, w, at, q_, v_, resting);
        const bool all_stick = std::all_of(resting.begin(), resting.end(), [&](int e) {
            return w.mode[e] == sticking || modes[e] != sticking;
        });
        w.mode = modes;
        want_rows(p, w);
        begin_step(p, w, at, q_, v_);
        return all_stick;
    };
    if (holds(begin + full)) return false;
    double low = 0.0, high = full;
    while (high - low > 1e-12 * std::max(std::abs(begin), full)) {
        const double mid = 0.5 * (low + high);
        stepper.step(begin, mid);
        settle(begin + mid, stepper.y1, stepper.f1);
        (holds(begin + mid) ? low : high) = mid;
    }
    stepper.step(begin, high);
    settle(begin + high, stepper.y1, stepper.f1);
    trigger_element = resting.front();
    released_together = true;
    return true;
}

void Simulation::remember_directions() {
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const Friction& f = p.frictions[e];
        if (f.dim == 1 || !slips(w.mode[e])) continue;
        const Vec3 u = slip_velocity(w, f);
        slip_at_start[e] = u.norm();
        if (u.norm() > 1e-12) w.slip_direction[e] = w.last_direction[e] = u.normalized();
    }
}

// A maintained contact that would have to pull, told once each time it begins.
void Simulation::report_pulls(double at) {
    for (size_t i = 0; i < p.contacts.size(); ++i) {
        const bool pull = static_cast<int>(i) == parting || w.lam[p.blocks[p.contacts[i]].row] < 0.0;
        if (pull && !pulls[i]) out.events.push_back({at, Event::Kind::pull, p.contacts[i]});
        pulls[i] = pull;
    }
    parting = -1;
}

// New modes for all elements at rest, found together; `trigger` has just come to rest or reached its limit.
void Simulation::switch_modes(double at, VecX& state, int trigger) {
    q_ = state.head(system.nq);
    v_ = state.segment(system.nq, system.nv);
    if (system.nz > 0) w.z = state.segment(system.nq + system.nv, system.nz);
    if (p.frictions.empty()) {
        begin_step(p, w, at, q_, v_);
        system.collect(at, state, derivative);
        return;
    }
    const std::vector<signed char> before = w.mode;
    const std::vector<Vec3> directions = w.slip_direction;
    if (trigger < 0) {  // the start: every element by its velocity
        std::fill(w.mode.begin(), w.mode.end(), 1);
        kinematics(p.mechanism, w.terms, q_, v_);
        evaluate_rows(p, w, at, v_);
    }
    std::vector<int> candidates;
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (e == trigger || at_rest(p, w, e, v_)) {
            candidates.push_back(e);
            continue;
        }
        follow_velocity(p, w, e);
    }
    const int breaking = released_together ? any_at_limit : trigger >= 0 && before[trigger] == sticking ? trigger : -1;
    released_together = false;
    for (;;) {
        resolve_modes(p, w, at, q_, v_, candidates, breaking);
        // What sticks from now on has no slip velocity at all, not one of rounding.
        project(p, w, at, q_, v_);
        begin_step(p, w, at, q_, v_);
        // Nearly redundant elements that stuck together leave one that slips a velocity, which may oppose its mode.
        const auto moving = std::stable_partition(candidates.begin(), candidates.end(), [&](int e) {
            return at_rest(p, w, e, v_) || speed_along(e) >= 0.0;
        });
        if (moving == candidates.end()) break;
        std::for_each(moving, candidates.end(), [&](int e) { follow_velocity(p, w, e); });
        candidates.erase(moving, candidates.end());
    }
    state.head(system.nq) = q_;
    state.segment(system.nq, system.nv) = v_;
    if (p.needs_reactions) gather_reactions(p, w);
    w.indeterminate = false;
    for (int e : candidates)
        if (w.mode[e] == sticking && ((e == trigger && before[e] == sticking) ||
            friction_force(p, w, e).norm() > static_limit(p, w, e, at, q_, v_) * (1.0 + 1e-9)))
            w.indeterminate = true;
    system.collect(at, state, derivative);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const bool turned = e == trigger && before[e] == 1 && w.mode[e] == 1 && p.frictions[e].dim > 1 &&
                            directions[e].dot(w.slip_direction[e]) < 0.0;
        if (trigger < 0 || (before[e] == w.mode[e] && !turned)) continue;
        const auto kind = w.mode[e] == sticking ? Event::Kind::stick
                          : before[e] == sticking ? Event::Kind::slip : Event::Kind::reverse;
        out.events.push_back({at, kind, e});
        recent_events.push_back(at);
    }
    if (trigger < 0) return;
    if (before == w.mode) recent_events.push_back(at);
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
