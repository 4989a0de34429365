#include "run/simulation.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

// At rest only the functions of the user tell when it ends. They are looked at in steps of this length at most [s], or
// of this part of the rest so far.
constexpr double rest_step = 0.1, rest_part_step = 0.002;

// The next step aims at error = safety^order, so far below the tolerance that what the motion adds to the error from
// one step to the next seldom rejects it: over smooth motions a sixth fewer evaluations to the same error than with 0.9,
// where a third of the steps fails. A step tried again knows its error, and aims closer.
constexpr double safety = 0.65, retry_safety = 0.9, shrink_limit = 0.2, growth_limit = 10.0;

// Unit roundoff in an acceleration at a sine s to a singular position: 1/s of it in the place, 1/s^2 in the velocity
// after projection, 1/s^3 where the rows are solved.
double rounding_at(double pivot) { return 2.2e-16 / (pivot * std::sqrt(pivot)); }
// A step whose evaluations come nearer than this part of its way through is shortened so, which moves them elsewhere.
constexpr double clearance = 0.04, detour = 0.85;
constexpr int detour_limit = 3;

// A run that has come less than this part of its way after so many steps never ends.
constexpr long early_steps = 20000;
constexpr double least_progress = 1e-10;

// Room for samples is taken at once up to this number; longer runs may stop before they fill it.
constexpr double most_reserved = 1e5;

}  // namespace

Simulation::Simulation(const Program& program, Workspace& workspace, const Options& options, Recording& recording)
    : p(program), w(workspace), o(options), out(recording), system(program, workspace, options.record.energy),
      stepper(options.method, system), recorder(system, options.record, recording) {
    t_end = o.t0 + o.duration;
    for (VecX* x : {&y, &derivative, &probe_, &probe_rate_}) *x = VecX::Zero(system.ny);
    q_ = VecX::Zero(system.nq);
    v_ = VecX::Zero(system.nv);
    pulls.assign(p.contacts.size(), 0);
    slip_at_start.assign(p.frictions.size(), 0.0);
}

// The only place where a run is interrupted or saved: what is left here is all that the next step needs.
void Simulation::between_steps() {
    try {
        if (o.tick && (++ticks & 15) == 0) o.tick(t);
    } catch (...) {
        if (o.save) save();
        throw;
    }
    if (o.save && Clock::now() >= next_save) save();
    if (out.steps == early_steps && t - o.t0 < least_progress * o.duration)
        throw Failure(Failure::Kind::step_size, t, {}, static_cast<double>(out.steps));
}

// --- Actuation and stops ------------------------------------------------------------------------------------------

void Simulation::sample_control(double now) {
    const auto* sampled = std::get_if<SampledTorque>(&p.actuation);
    if (!sampled || w.now.has_override) return;
    if (w.state.has_held && now < o.t0 + next_period * sampled->period) return;
    q_ = y.head(system.nq);
    v_ = y.segment(system.nq, system.nv);
    sampled->function(now, q_, v_, w.state.held_torque);
    w.state.has_held = true;
    next_period = static_cast<long>(std::floor((now - o.t0) / sampled->period * (1.0 + 1e-14) + 1e-9)) + 1;
    // The torque jumps here: the derivative is taken anew.
    begin_step(p, w, now, q_, v_);
    system.collect(now, y, derivative);
}

double Simulation::next_stop(double now) const {
    double stop = t_end;
    if (const auto* sampled = std::get_if<SampledTorque>(&p.actuation))
        stop = std::min(stop, o.t0 + next_period * sampled->period);
    if (const auto* table = std::get_if<TorqueTable>(&p.actuation)) {
        const auto next = std::upper_bound(table->times.begin(), table->times.end(), now);
        if (next != table->times.end()) stop = std::min(stop, *next);
    }
    return stop;
}

// --- Samples --------------------------------------------------------------------------------------------------------

void Simulation::emit(double at, const VecX& state, bool evaluated) {
    if (!out.t.empty() && at <= out.t.back()) return;
    recorder.sample(at, state, evaluated);
}

// Samples of the output grid before t_now, from the interpolant of the last step.
void Simulation::emit_between(double t_now) {
    while (o.output_dt > 0.0 && next_sample < t_now - 1e-12 * std::max(1.0, std::abs(t_now))) {
        stepper.make_dense();
        stepper.interpolate((next_sample - stepper.t0) / stepper.h, probe_);
        q_ = probe_.head(system.nq);
        v_ = probe_.segment(system.nq, system.nv);
        if (!w.now.rows.blocks.empty()) {
            project(p, w, next_sample, q_, v_);
            probe_.head(system.nq) = q_;
            probe_.segment(system.nq, system.nv) = v_;
        }
        emit(next_sample, probe_, false);
        next_sample = o.t0 + ++samples * o.output_dt;
    }
}

// --- Steps ----------------------------------------------------------------------------------------------------------

double Simulation::energy_at(const VecX& state) {
    q_ = state.head(system.nq);
    v_ = state.segment(system.nq, system.nv);
    place_bodies(p.mechanism, w.now.terms, q_);
    mass_matrix(p.mechanism, w.now.terms);
    return kinetic_energy(p.mechanism, w.now.terms, v_) + potential_energy(p.mechanism, w.now.terms);
}

void Simulation::settle(double at, VecX& state, VecX& rate) {
    double before = 0.0;
    if (o.record.energy && !w.now.rows.blocks.empty()) before = energy_at(state);
    q_ = state.head(system.nq);
    v_ = state.segment(system.nq, system.nv);
    if (system.nz > 0) w.state.z = state.segment(system.nq + system.nv, system.nz);
    bool moved = project_position(p, w, at, q_, v_);
    require_closed(p, w, at);
    moved |= begin_step_on_rates(p, w, at, v_);
    state.head(system.nq) = q_;
    state.segment(system.nq, system.nv) = v_;
    system.collect(at, state, rate);
    if (moved && o.record.energy)
        pending_energy = kinetic_energy(p.mechanism, w.now.terms, v_) + potential_energy(p.mechanism, w.now.terms) - before;
    else pending_energy = 0.0;
}

void Simulation::start(const VecX& q0, const VecX& v0) {
    t = o.t0;
    y.setZero();
    y.head(system.nq) = q0;
    y.segment(system.nq, system.nv) = v0;
    if (system.nz > 0) y.segment(system.nq + system.nv, system.nz) = w.state.z;
    next_sample = o.t0 + o.output_dt;
    samples = 1;
    const double apart = o.output_dt > 0.0 ? o.output_dt : o.dt;  // the steps of adaptive methods are not known before
    if (apart > 0.0) recorder.reserve(static_cast<size_t>(std::min(o.duration / apart + 2.0, most_reserved)));
    w.state.has_held = false;
    w.state.warm = false;
    next_period = 0;
    sample_control(t);
    switch_modes(t, y, -1);
    out.events.clear();
    emit(t, y, true);
    report_pulls(t);
    h = o.dt;
    if (o.method.adaptive) {
        stepper.K[0] = derivative;
        h = stepper.initial_step(t, y, o.rtol, o.atol, t_end - t);
        begin_step(p, w, t, q_ = y.head(system.nq), v_ = y.segment(system.nq, system.nv));
    }
}

void Simulation::run() {
    while (t < t_end) {
        between_steps();
        if (o.method.kind == Method::Kind::moreau) {
            step_in_time(t_end, o.dt);
            continue;
        }
        sample_control(t);
        double stop = next_stop(t);
        if (!o.method.adaptive) {  // the fixed grid, whatever events cut out of it
            const double k = std::floor((t - o.t0) / o.dt * (1.0 + 1e-14) + 1e-9) + 1.0;
            stop = std::min(stop, o.t0 + k * o.dt);
        }
        advance_to(stop);
    }
    if (o.save) save();
}

// One accepted step, or one that ends at an event, not beyond `stop`.
void Simulation::advance_to(double stop) {
    const double remaining = stop - t;
    double size = o.method.adaptive ? h : remaining;
    if (o.method.adaptive && p.asks_functions && (system.v(y).array() == 0.0).all()) {
        const double since = out.events.empty() ? o.t0 : out.events.back().time;
        size = std::min(size, std::max(rest_step, rest_part_step * (t - since)));
    }
    bool last = false;
    if (size >= remaining * (1.0 - 1e-10)) {
        size = remaining;
        last = true;
    } else if (size > 0.5 * remaining) {
        size = 0.5 * remaining;  // two even steps instead of a long and a tiny one
    }
    if (!o.method.adaptive && !p.frictions.empty()) {
        const double shorter = toward_rest(size);
        last &= shorter == size;
        size = shorter;
    }
    stepper.y0 = y;
    stepper.K[0] = derivative;
    double error = 0.0;
    try {
        const double start_pivot = w.now.rows.distance;
        system.on_constraints = start_pivot < near_singular && !w.now.rows.blocks.empty();
        system.smallest_pivot = 1.0;
        stepper.step(t, size);
        if (system.smallest_pivot < near_singular && !system.on_constraints) {
            system.on_constraints = true;
            stepper.step(t, size);
        }
        if (!stepper.y1.allFinite()) throw Failure(Failure::Kind::not_finite, t + size);
        const double way = std::sqrt(start_pivot) + std::sqrt(w.now.rows.distance);
        if (o.method.adaptive && std::sqrt(system.smallest_pivot) < clearance * way &&
            rounding_at(system.smallest_pivot) > o.rtol && detours++ < detour_limit) {
            h = detour * size;
            ++out.rejected;
            return;
        }
        if (o.method.kind == Method::Kind::dop853) error = stepper.error_norm(o.rtol, o.atol);
        if (error <= 1.0) {
            settle(t + size, stepper.y1, stepper.f1);
            if (o.method.kind == Method::Kind::semi_implicit_euler) learn_third_order(w, size);
            if (o.method.kind == Method::Kind::dopri5) error = stepper.error_norm(o.rtol, o.atol);
        }
    } catch (const Failure& failure) {
        // A stage may leave the domain where the step is too long; a shorter one decides whether it is the motion.
        // Where the motion runs away no step is short enough, and that is what is wrong.
        const double tiny = 1e-10 * std::max(1.0, std::abs(t));
        const bool runs_away = tiny * derivative.segment(system.nq, system.nv).norm() > system.v(y).norm();
        if (!o.method.adaptive || (size < tiny && !runs_away) || failure.kind == Failure::Kind::interrupted) throw;
        if (failure.kind == Failure::Kind::closure) opened = failure;
        error = 1e4;
    }
    if (!(error <= 1.0)) {
        ++out.rejected;
        const double factor = std::isfinite(error) ? retry_safety * std::pow(error, -1.0 / o.method.order) : 0.0;
        h = size * std::max(shrink_limit, factor);
        last_rejected = true;
        if (!(h >= 4.0 * std::abs(std::nextafter(t, t_end) - t))) {
            if (opened) throw *opened;
            throw Failure(Failure::Kind::step_size, t);
        }
        q_ = y.head(system.nq);
        v_ = y.segment(system.nq, system.nv);
        return;
    }
    if (o.method.adaptive) {
        double factor = growth_limit;
        if (error > 0.0) factor = std::min(factor, safety * std::pow(error, -1.0 / o.method.order));
        if (last_rejected) factor = std::min(1.0, factor);
        last_rejected = false;
        if (!(last && factor * size < h)) h = size * std::max(factor, shrink_limit);
    }
    detours = 0;
    opened.reset();
    const bool event = locate_event();
    ++out.steps;
    t = event || !last ? stepper.t0 + stepper.h : stop;
    recorder.moved_energy += pending_energy;
    remember_directions();
    emit_between(t);
    y = stepper.y1;
    derivative = stepper.f1;
    if (event && trigger_element != no_trigger) {
        switch_modes(t, y, trigger_element);
        emit(t, y, true);
        return;
    }
    if (event && parting < 0) {
        recent_events.push_back(t);
        bridge_cluster(t, y, located_element);
    }
    report_pulls(t);
    const bool on_grid = o.output_dt > 0.0 && std::abs(next_sample - t) <= 1e-12 * std::max(1.0, std::abs(t));
    if (o.output_dt == 0.0 || on_grid || t >= t_end) {
        if (on_grid) next_sample = o.t0 + ++samples * o.output_dt;
        q_ = y.head(system.nq);
        v_ = y.segment(system.nq, system.nv);
        if (stepper.has_dense) evaluate(p, w, t, q_, v_);
        emit(t, y, true);
    }
}

template <class Steps>
static void keep_what_stops(Recording& out, Steps steps) {
    try {
        steps();
    } catch (const Failure& failure) {
        out.failure = failure;
    } catch (...) {
        out.error = std::current_exception();
    }
}

void simulate(const Program& p, Workspace& w, const VecX& q0, const VecX& v0, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    keep_what_stops(out, [&] {
        simulation.start(q0, v0);
        simulation.run();
    });
}

void resume(const Program& p, Workspace& w, const std::string& state, const Options& options, Recording& out) {
    Simulation simulation(p, w, options, out);
    simulation.restore(state);
    keep_what_stops(out, [&] { simulation.run(); });
}

}  // namespace pn
