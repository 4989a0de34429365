#include "run/events/breaks.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "constraints/schur_factor.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "tree/terms.hpp"

namespace pn {

namespace {

struct Probe {
    double t;
    Jet f;
};

Probe probe(const TimeFunction& f, double t) { return {t, evaluate(f, t)}; }

// Compute the change of the rate beyond the integral of the accelerations. Add the change of the value beyond the
// integral of the rates, over the length of the interval. Both integrals use the trapezoidal rule, the second with its
// correction.
double rate_defect(const Probe& a, const Probe& b) {
    const double h = b.t - a.t;
    const double rate = b.f[1] - a.f[1] - 0.5 * h * (a.f[2] + b.f[2]);
    const double value = b.f[0] - a.f[0] - 0.5 * h * (a.f[1] + b.f[1]) + h * h / 12.0 * (b.f[2] - a.f[2]);
    const double rounding = 8.0 * std::numeric_limits<double>::epsilon() * (std::abs(a.f[0]) + std::abs(b.f[0]));
    return std::abs(rate) + std::max(0.0, std::abs(value) - rounding) / h;
}

double rate_size(const Probe& a, const Probe& b) {
    const double h = b.t - a.t;
    return std::abs(a.f[1]) + std::abs(b.f[1]) + h * (std::abs(a.f[2]) + std::abs(b.f[2])) +
           std::abs(b.f[0] - a.f[0]) / h;
}

double acceleration_change(const Probe& a, const Probe& b) { return std::abs(b.f[2] - a.f[2]); }

// Return the first point after the jump that causes most of the defect, to neighboring floating-point times. Return
// nothing if the function is smooth.
std::optional<Probe> find_jump(const TimeFunction& f, Probe& a, Probe b, double (*defect)(const Probe&, const Probe&)) {
    const double min_defect = Breaks::parameters.kept_part * defect(a, b);
    for (;;) {
        const double middle = a.t + 0.5 * (b.t - a.t);
        if (!(a.t < middle && middle < b.t)) return b;
        const Probe m = probe(f, middle);
        const double left = defect(a, m), right = defect(m, b);
        if (!(std::max(left, right) >= min_defect)) return std::nullopt;
        (left >= right ? b : a) = m;
    }
}

}  // namespace

Breaks::Breaks(System& system, Progress& progress, Output& output, Recording& out)
    : p(system.p), w(system.w), system_(system), progress_(progress), output_(output), out_(out) {
    for (int i = 0; i < p.constraints; ++i)
        for (const TimeFunction* f : time_functions(p.blocks[i].kind)) motions_.push_back({i, f});
}

void Breaks::enter(double time) {
    const auto after = std::upper_bound(p.breaks.begin(), p.breaks.end(), time);
    double last = after == p.breaks.begin() ? -HUGE_VAL : *(after - 1);
    double next = after == p.breaks.end() ? HUGE_VAL : *after;
    double& found = progress_.detected_break;
    if (found <= time) {
        last = std::max(last, found);
        found = HUGE_VAL;
    }
    next = std::min(next, found);
    progress_.last_break = last;
    progress_.next_break = next;
    w.now.set_stretch(last, next);
}

double Breaks::next(double after) const {
    const auto next_break = std::upper_bound(p.breaks.begin(), p.breaks.end(), after);
    const double detected = progress_.detected_break > after ? progress_.detected_break : HUGE_VAL;
    return std::min(detected, next_break == p.breaks.end() ? HUGE_VAL : *next_break);
}

std::vector<double> Breaks::rates(double t) const {
    std::vector<double> rates;
    for (const Motion& motion : motions_) rates.push_back(evaluate(*motion.function, w.now.row_time(t))[1]);
    return rates;
}

bool Breaks::pass() {
    const std::vector<double> before = rates(progress_.t);
    enter();
    const std::vector<double> after = rates(progress_.t);
    system_.read(progress_.y);
    const double allowed = parameters.rate_rounding * (1.0 + system_.v.cwiseAbs().maxCoeff());
    bool jumps = false;
    for (size_t i = 0; i < motions_.size(); ++i) jumps |= std::abs(after[i] - before[i]) > allowed;
    if (jumps) {
        jump(before, after);
        if (system_.has_events()) return true;
    } else {
        // The rates agree up to the rounding error of the time, which fast accelerations magnify.
        begin_rows(p, w, progress_.t, system_.q, system_.v);
        project_velocity(p, w, progress_.t, system_.v);
        system_.write(progress_.y);
    }
    begin_step(p, w, progress_.t, system_.q, system_.v);
    system_.rate_of_evaluation(progress_.t, progress_.y, progress_.rate);
    output_.configured_now();
    return jumps;
}

// Solve M (v+ - v-) = A^T I, A v+ + phi_t+ = 0 for the constraints alone. Contact impacts follow afterwards. Dry
// friction has finite forces and gives no impulse.
void Breaks::jump(const std::vector<double>& before, const std::vector<double>& after) {
    output_.before_jump();
    system_.read(progress_.y);
    const std::vector<char> closed = w.state.closed;
    const std::vector<Mode> modes = w.state.mode;
    if (!p.gaps.empty()) set_closed(p, w, std::vector<char>(p.gaps.size(), 0));
    if (!p.frictions.empty()) set_modes(p, w, std::vector<Mode>(p.frictions.size(), slip_plus));
    VecX &v = system_.v, v_minus = v;
    begin_rows(p, w, progress_.t, system_.q, v);
    const double energy = kinetic_energy(p.mechanism, w.now.terms, v);
    project_velocity(p, w, progress_.t, v);
    const double work = kinetic_energy(p.mechanism, w.now.terms, v) - energy;
    const VecX change = v - v_minus;
    VecX impulse = VecX::Zero(w.now.lam.size());
    for (int i : w.now.rows.blocks) multiply(p.blocks[i], w.now.A, change, w.scratch.r);
    solve_rows(w.now.rows, w.scratch.r, impulse);
    append_event(before, after, v_minus, impulse);
    system_.write(progress_.y);
    if (system_.energy) system_.work(progress_.y)[constraint_power] += work;
    else progress_.numerical_energy += work;
    if (!p.gaps.empty()) set_closed(p, w, closed);
    if (!p.frictions.empty()) set_modes(p, w, modes);
}

void Breaks::append_event(const std::vector<double>& before, const std::vector<double>& after, const VecX& v_minus,
                          const VecX& impulse) {
    const double allowed = parameters.rate_rounding * (1.0 + v_minus.cwiseAbs().maxCoeff());
    for (size_t i = 0; i < motions_.size(); ++i) {
        if (!(std::abs(after[i] - before[i]) > allowed)) continue;
        const Block& block = p.blocks[motions_[i].block];
        const double along = block.kept.empty() ? 0.0 : impulse[block.row];
        out_.events.push_back({progress_.t, Event::Kind::jump, motions_[i].block, Vec3(along, 0.0, 0.0),
                               0.5 * (before[i] + after[i]) * along, v_minus, system_.v});
    }
}

void Breaks::find_in_step(double end, bool adaptive) {
    const int intervals = adaptive ? parameters.adaptive_intervals : 1;
    end = w.now.row_time(end);
    for (const Motion& motion : motions_) {
        const TimeFunction& f = *motion.function;
        if (!is_users(f)) continue;
        const double begin = w.now.row_time(progress_.t);
        if (!(begin < end)) return;
        std::optional<Probe> jump;
        Probe before = probe(f, begin);
        for (int k = 1; k <= intervals && !jump; ++k) {
            const Probe a = before, b = probe(f, begin + (end - begin) * k / intervals);
            if (!(a.t < b.t)) break;
            if (rate_defect(a, b) > parameters.unexplained * rate_size(a, b))
                jump = find_jump(f, before, b, rate_defect);
            if (jump) break;
            before = a;
            if (acceleration_change(a, b) > parameters.uneven * std::max(std::abs(a.f[2]), std::abs(b.f[2])))
                jump = find_jump(f, before, b, acceleration_change);
            if (!jump) before = b;
        }
        if (!jump) continue;
        if (std::abs(jump->f[0] - before.f[0]) > parameters.value_jump)
            throw Failure(Failure::Kind::closure, jump->t, {motion.block}, std::abs(jump->f[0] - before.f[0]));
        if (jump->t < progress_.detected_break) progress_.detected_break = jump->t;
        enter();
        end = w.now.row_time(end);
    }
}

}  // namespace pn
