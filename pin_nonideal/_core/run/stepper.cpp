#include "run/stepper.hpp"

namespace pn {

Stepper::Stepper(const Method& chosen, System& system)
    : Step(chosen.stages, chosen.rates(), system.ny), method(chosen), system_(system) {
    if (method.scheme == Method::Scheme::runge_kutta) scheme_.emplace<RungeKutta>(method, *this);
    if (method.scheme == Method::Scheme::semi_implicit_euler) scheme_.emplace<SemiImplicitEuler>(*this);
    if (method.outside()) scheme_.emplace<OutsideStep>(method, *this);
}

// Calls `use` with the stepper that the method has; time stepping is no business of these.
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
    with_scheme(scheme_, [&](auto& scheme) { scheme.advance(system_); });
}

void Stepper::move_end(double dt) {
    h += dt;
    y1 += dt * end_rate();
    system_.normalize(y1);
    has_interpolant_ = false;
}

void Stepper::follow(double t, double size, OutsideStep::Interpolant interpolant) {
    auto& outside = std::get<OutsideStep>(scheme_);
    outside.set_interpolant(std::move(interpolant));
    take(t, size);
    if (system_.ne > 0) outside.look_inside(system_);
}

double Stepper::error(ErrorNorm& norm) {
    if (!method.adaptive()) return 0.0;
    norm.set_tolerances(y0, y1, h);
    return std::get<RungeKutta>(scheme_).error(norm);
}

void Stepper::learn() {
    if (const auto* euler = std::get_if<SemiImplicitEuler>(&scheme_)) euler->learn(system_);
}

void Stepper::make_interpolant() {
    if (has_interpolant_) return;
    has_interpolant_ = true;
    with_scheme(scheme_, [&](auto& scheme) { scheme.make_interpolant(system_); });
}

void Stepper::interpolate(double part, VecX& y) const {
    with_scheme(scheme_, [&](const auto& scheme) { scheme.interpolate(part, y); });
    system_.normalize(y);
}

double Stepper::interpolated(double part, int index) const {
    double value = 0.0;
    with_scheme(scheme_, [&](const auto& scheme) { value = scheme.interpolated(part, index).first; });
    return value;
}

double Stepper::interpolated_rate(double part, int index) const {
    double rate = 0.0;
    with_scheme(scheme_, [&](const auto& scheme) { rate = scheme.interpolated(part, index).second / h; });
    return rate;
}

}  // namespace pn
