#include "run/integrators/stepper.hpp"

#include <algorithm>

namespace pn {

Stepper::Stepper(const Method& chosen, System& system, ErrorNorm& norm)
    : Step(chosen.stages, chosen.rates(), system.ns, system.ny), method(chosen), system_(system), norm_(norm),
      collocation_(*this, system, norm) {
    if (method.scheme == Method::Scheme::runge_kutta) scheme_.emplace<RungeKutta>(method, *this);
    if (method.scheme == Method::Scheme::semi_implicit_euler) scheme_.emplace<SemiImplicitEuler>(*this, system.p);
    if (method.outside()) scheme_.emplace<OutsideStep>(method, *this);
    system.can_solve_directions = !method.outside();
    for (int i = 0; i < stages; ++i)
        if (i == 0 || (method.C && method.C[i] < 1.0)) rate_samples_.push_back({i == 0 ? 0.0 : method.C[i], &rates[i]});
    const auto precedes = [](const RateSample& a, const RateSample& b) { return a.part < b.part; };
    std::stable_sort(rate_samples_.begin(), rate_samples_.end(), precedes);
    // Keep the last stage at each instant, which is the most accurate.
    const auto same = [](const RateSample& a, const RateSample& b) { return a.part == b.part; };
    rate_samples_.erase(rate_samples_.begin(), std::unique(rate_samples_.rbegin(), rate_samples_.rend(), same).base());
    collocation_samples_.push_back({0.0, &rates[0]});
    for (int i = 0; i + 1 < Collocation::stages; ++i)
        collocation_samples_.push_back({Collocation::abscissa(i), &collocation_.rate(i)});
    for (auto* list : {&rate_samples_, &collocation_samples_}) list->push_back({1.0, &end_rate()});
}

// Call `use` with the scheme of the method. Time stepping has none here.
template <class Scheme, class Use>
static void with_scheme(Scheme& scheme, const Use& use) {
    if (auto* runge_kutta = std::get_if<RungeKutta>(&scheme)) use(*runge_kutta);
    else if (auto* euler = std::get_if<SemiImplicitEuler>(&scheme)) use(*euler);
    else if (auto* outside = std::get_if<OutsideStep>(&scheme)) use(*outside);
}

void Stepper::take(double t, double size) {
    t0 = t;
    h = size;
    has_interpolant_ = false;
    RunState& state = system_.w.state;
    system_.w.scratch.factored_unknowns = 0;  // a step does not depend on the previous step, so that runs can resume
    if (state.solves_directions) state.solves_directions = collocation_.has_directions();
    collocates_ = state.solves_directions;
    active = system_.active();
    if (collocates_) {
        collocation_.advance();
        if (collocation_.is_solved() || method.adaptive()) return;
        // A fixed step cannot be shortened.
        collocates_ = state.solves_directions = false;
        state.last_direction = state.slip_direction;
    }
    if (std::holds_alternative<RungeKutta>(scheme_) && system_.stands(y0, start_rate())) return stand();
    with_scheme(scheme_, [&](auto& scheme) { scheme.advance(system_); });
}

// All stages of a step at rest are its start.
void Stepper::stand() {
    const VecX& rate = start_rate();
    for (int i = 1; i < stages; ++i) rates[i].head(active) = rate.head(active);
    y1.head(active) = y0.head(active) + h * rate.head(active);
    const RowSystem& rows = system_.w.now.rows;
    if (!rows.blocks.empty()) system_.smallest_pivot = std::min(system_.smallest_pivot, rows.distance);
}

void Stepper::repeat(double size) {
    if (auto* euler = std::get_if<SemiImplicitEuler>(&scheme_)) euler->return_to_start(system_);
    take(t0, size);
    if (collocates_ && !collocation_.is_solved()) throw Failure(Failure::Kind::not_converged, t0);
}

void Stepper::end_at(double size) {
    repeat(size);
    system_.project_and_evaluate(t0 + size, y1, end_rate());
}

void Stepper::move_end(double dt) {
    y1 += dt * end_rate() + 0.5 * dt * (dt / h) * (end_rate() - start_rate());
    h += dt;
    system_.normalize(y1);
    has_interpolant_ = false;
}

void Stepper::follow(double t, double size, OutsideStep::Interpolant interpolant) {
    auto& outside = std::get<OutsideStep>(scheme_);
    outside.set_interpolant(std::move(interpolant));
    take(t, size);
    if (system_.ne > 0) outside.evaluate_inside(system_);
}

double Stepper::error() {
    if (!method.adaptive()) return 0.0;
    if (collocates_) return collocation_.error();
    norm_.set_tolerances(y0, y1, h);
    return std::get<RungeKutta>(scheme_).error(norm_);
}

double Stepper::stiffness() const {
    if (collocates_) return collocation_.stiffness();
    const double apart = (system_.velocity(y1) - system_.velocity(last_stage())).norm();
    if (!(apart > 0.0)) return 0.0;
    return h * (system_.velocity(rates[stages]) - system_.velocity(rates[stages - 1])).norm() / apart;
}

void Stepper::learn() {
    if (collocates_) return;
    if (const auto* euler = std::get_if<SemiImplicitEuler>(&scheme_)) euler->learn(system_);
}

void Stepper::make_interpolant() {
    if (has_interpolant_) return;
    has_interpolant_ = true;
    if (collocates_) return;
    with_scheme(scheme_, [&](auto& scheme) { scheme.make_interpolant(system_); });
}

void Stepper::interpolate(double part, VecX& y) const {
    if (collocates_) collocation_.interpolate(part, y);
    else with_scheme(scheme_, [&](const auto& scheme) { scheme.interpolate(part, y); });
    system_.normalize(y);
}

double Stepper::interpolated(double part, int index) const {
    double value = 0.0;
    if (collocates_) return collocation_.interpolated(part, index);
    with_scheme(scheme_, [&](const auto& scheme) { value = scheme.interpolated(part, index).first; });
    return value;
}

double Stepper::interpolated_rate(double part, int index) const {
    double rate = 0.0;
    if (collocates_) return collocation_.interpolated_rate(part, index);
    with_scheme(scheme_, [&](const auto& scheme) { rate = scheme.interpolated(part, index).second / h; });
    return rate;
}

}  // namespace pn
