// Where an event lies inside a step.
//
// A slipping element watches its slip velocity, a sticking one its multiplier against the static limit, a contact its
// normal force. The interpolant gives the first guess of the instant; the step is then taken again up to there and the
// guess corrected by Newton's or the secant method, so that an event is as accurate as a step.
#include <algorithm>
#include <cmath>

#include "run/simulation.hpp"

namespace pn {

namespace {

constexpr int location_grid = 24;  // points of a step at which a margin is looked at first
constexpr int dip_passes = 40;     // golden sections: a dip of 1e-16 of the margin's own change
constexpr double beyond = 2.0;     // part of a step: none of it

}  // namespace

// Slip speed the way that the mode says.
double Simulation::speed_along(int e) const {
    const Friction& f = p.frictions[e];
    const Vec3 u = slip_velocity(w.now, f);
    return f.dim == 1 ? w.state.mode[e] * u[0] : u.dot(w.state.slip_direction[e]);
}

// Positive before the event, zero at it. The workspace must be evaluated at the state.
double Simulation::margin(const Watch& watch, double at, const VecX& state) {
    if (watch.contact >= 0) return w.now.lam[p.blocks[p.contacts[watch.contact]].row];
    if (watch.slip) return speed_along(watch.element);
    q_ = state.head(system.nq);
    v_ = state.segment(system.nq, system.nv);
    return static_limit(p, w, watch.element, at, q_, v_) * (1.0 + 1e-12) - friction_force(p, w, watch.element).norm();
}

// Fixed steps shrink toward the rest of a slip of several directions, whose direction may turn fast at the end.
double Simulation::toward_rest(double size) {
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const Friction& f = p.frictions[e];
        if (f.dim == 1 || !slips(w.state.mode[e])) continue;
        const Block& block = p.blocks[f.block];
        q_ = y.head(system.nq);
        v_ = derivative.segment(system.nq, system.nv);
        multiply(block, w.now.A, v_, w.scratch.r);
        const double slip = slip_velocity(w.now, f).squaredNorm();
        double change = 0.0;
        for (int k = 0; k < f.dim; ++k) {
            const double rate = w.scratch.r[block.row + k] - w.now.b[block.row + k];
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
            if (!pulls[i] && w.now.lam[p.blocks[p.contacts[i]].row] < 0.0) list.push_back({-1, false, i});
    if (p.frictions.empty()) return list;
    const double t1 = stepper.t0 + stepper.h;
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        const Watch watch{e, w.state.mode[e] != sticking};
        if (!watch.slip) {
            if (w.state.indeterminate) continue;
            bool past = margin(watch, t1, stepper.y1) < 0.0;
            double least = HUGE_VAL, most = -HUGE_VAL;  // or may have been past it inside, between two stages
            for (int i = 0; i < stepper.method.stages; ++i) {
                const double share = stepper.K[i][system.ny - system.ne + e];
                least = std::min(least, share);
                most = std::max(most, share);
            }
            const double range = most - least;
            past |= std::max(std::abs(least), std::abs(most)) + 0.5 * range > 1.0 + 1e-9 && range > 1e-9;
            if (past) list.push_back(watch);
            continue;
        }
        const double speed = stepper.y1.segment(system.nq, system.nv).cwiseAbs().maxCoeff();
        const double noise = 1e-3 * rest_speed * (1.0 + speed);  // of an element that has just begun to slip
        if (p.frictions[e].dim > 1 && !stepper.method.adaptive) {
            const double now = slip_velocity(w.now, p.frictions[e]).norm();
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
        const double s = w.state.mode[e], u0 = s * stepper.y0[i], u1 = s * stepper.y1[i];
        const double a0 = s * stepper.h * stepper.K[0][i], a1 = s * stepper.h * stepper.f1[i];
        for (double x : {0.2, 0.4, 0.6, 0.8}) {
            const double z = 1.0 - x;
            const double u = z * z * (1.0 + 2.0 * x) * u0 + x * x * (1.0 + 2.0 * z) * u1 + x * z * (z * a0 - x * a1);
            if (u < -noise) { list.push_back(watch); break; }
        }
    }
    return list;
}

// Root of a margin between a part of the step where it is positive and one where it is negative: secants, kept inside
// (Illinois).
template <class Margin>
static double root_between(double low, double gl, double high, double gh, const Margin& margin) {
    if (gl <= 0.0) return low;  // it starts at zero and goes the wrong way at once
    int side = 0;
    for (int it = 0; it < 60 && high - low > 1e-13; ++it) {
        double mid = (low * gh - high * gl) / (gh - gl);
        if (!(mid > low && mid < high)) mid = 0.5 * (low + high);
        const double g = margin(mid);
        if (std::abs(g) < 1e-13) return mid;
        if (g > 0.0) {
            low = mid; gl = g;
            if (side == 1) gh *= 0.5;
            side = 1;
        } else {
            high = mid; gh = g;
            if (side == -1) gl *= 0.5;
            side = -1;
        }
    }
    return high;
}

// A place between a and b where the margin is negative, by golden sections toward its least value; none: b.
template <class Margin>
static double dip_between(double a, double b, const Margin& margin, double& value) {
    constexpr double golden = 0.3819660112501051;
    const double end = b;
    double x1 = a + golden * (b - a), x2 = b - golden * (b - a), g1 = margin(x1), g2 = margin(x2);
    for (int it = 0; it < dip_passes; ++it) {
        if (std::min(g1, g2) < 0.0) {
            value = std::min(g1, g2);
            return g1 < g2 ? x1 : x2;
        }
        if (g1 < g2) {
            b = x2; x2 = x1; g2 = g1;
            g1 = margin(x1 = a + golden * (b - a));
        } else {
            a = x1; x1 = x2; g1 = g2;
            g2 = margin(x2 = b - golden * (b - a));
        }
    }
    return end;
}

// Part of the step at which a watched margin first falls below zero, on a grid and between its points; beyond the step
// where it does not.
double Simulation::first_crossing(const Watch& watch) {
    const auto margin_at = [&](double s) {
        const double at = stepper.t0 + s * stepper.h;
        stepper.interpolate(s, probe_);
        system.derivative(at, probe_, probe_rate_);
        return margin(watch, at, probe_);
    };
    double g[location_grid + 1];
    g[0] = margin_at(0.0);
    for (int k = 1; k <= location_grid; ++k) {
        constexpr double part = 1.0 / location_grid;
        g[k] = margin_at(k * part);
        if (g[k] < 0.0) return root_between((k - 1) * part, g[k - 1], k * part, g[k], margin_at);
        if (k == 1 || g[k - 1] > g[k - 2] || g[k - 1] > g[k]) continue;
        const double curve = g[k - 2] - 2.0 * g[k - 1] + g[k];  // a parabola lies lower by an eighth of it at most
        if (g[k - 1] > 0.25 * curve) continue;
        double value = 0.0;
        const double dip = dip_between((k - 2) * part, k * part, margin_at, value);
        if (value < 0.0) return root_between((k - 2) * part, g[k - 2], dip, value, margin_at);
    }
    return beyond;
}

// Takes the step again up to the event, and corrects the instant by what the margin is there.
void Simulation::step_onto(const Watch& found, double part) {
    const double full = stepper.h, begin = stepper.t0;
    double size = std::clamp(part, 0.0, 1.0) * full, before = 0.0, margin_before = 0.0;
    for (int it = 0; it < 12; ++it) {
        stepper.step(begin, size);
        settle(begin + size, stepper.y1, stepper.f1);
        const double g = margin(found, begin + size, stepper.y1);
        double slope = 0.0;
        if (found.slip && p.frictions[found.element].dim == 1) {
            const Block& block = p.blocks[p.frictions[found.element].block];
            multiply(block, w.now.A, w.now.a, w.scratch.r);
            slope = w.state.mode[found.element] * (w.scratch.r[block.row] - w.now.b[block.row]);
        } else if (it == 0) {
            const double d = std::max(1e-6 * full, 1e-12);
            slope = 0.0;
            before = size;
            margin_before = g;
            const double other = std::max(0.0, size - d);
            if (other < size) {
                stepper.step(begin, other);
                settle(begin + other, stepper.y1, stepper.f1);
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
    stepper.make_dense();
    double first = beyond;
    Watch found{-1, false};
    for (const Watch& watch : watches) {
        const double part = first_crossing(watch);
        if (part < first) { first = part; found = watch; }
    }
    if (first == beyond) {  // what may have crossed did not
        q_ = stepper.y1.head(system.nq);
        v_ = stepper.y1.segment(system.nq, system.nv);
        if (system.nz > 0) w.state.z = stepper.y1.segment(system.nq + system.nv, system.nz);
        evaluate(p, w, stepper.t0 + stepper.h, q_, v_);
        return false;
    }
    trigger_element = found.contact < 0 ? found.element : no_trigger;
    located_element = found.element;
    parting = found.contact;
    step_onto(found, first);
    if (found.contact >= 0) return true;
    // Slip of several directions may turn far without coming to rest: then the step just ends here. It has come to
    // rest when hardly anything is left of the slip that the step began with.
    const Friction& f = p.frictions[found.element];
    if (found.slip && f.dim > 1) {
        const double speed = stepper.y1.segment(system.nq, system.nv).cwiseAbs().maxCoeff();
        const double now = slip_velocity(w.now, f).norm();
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
    if (!w.state.indeterminate) return false;
    const double full = stepper.h, begin = stepper.t0;
    const std::vector<signed char> modes = w.state.mode;
    ModeQuestion asked;
    const auto holds = [&](double at) {
        q_ = stepper.y1.head(system.nq);
        v_ = stepper.y1.segment(system.nq, system.nv);
        asked = {modes, {}, {}};
        for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
            if (at_rest(p, w, e, v_)) asked.at_rest.push_back(e);
        resolve_modes(p, w, at, q_, v_, asked);
        const bool all_stick = std::all_of(asked.at_rest.begin(), asked.at_rest.end(), [&](int e) {
            return w.state.mode[e] == sticking || modes[e] != sticking;
        });
        set_modes(p, w, modes);
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
    trigger_element = asked.at_rest.front();
    released_together = true;
    return true;
}

}  // namespace pn
