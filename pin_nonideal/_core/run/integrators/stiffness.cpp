#include "run/integrators/stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

namespace pn {

StiffnessGuard::StiffnessGuard(System& system, Stepper& stepper, Progress& progress, const Options& options)
    : system_(system), stepper_(stepper), progress_(progress), options_(options),
      max_steps_(options.max_steps > 0 ? static_cast<double>(options.max_steps) : parameters.usual_steps) {
    reset();
}

void StiffnessGuard::reset() {
    start_time_ = Clock::now();
    steps_ = 0;
    const bool estimates = options_.hint && options_.max_steps == 0;
    next_estimate_steps_ = estimates ? parameters.first_estimate_steps : parameters.no_estimate_steps;
}

double StiffnessGuard::FastestMode::rate() const { return std::hypot(decay, frequency); }

bool StiffnessGuard::FastestMode::decays() const { return decay > parameters.min_damping * rate(); }

// Estimate the change of the rate with the state from two evaluations at the step's end: last stage, and result.
double StiffnessGuard::stage_rate() const {
    const int n = system_.nq + system_.nv + system_.nz;
    const double apart = (stepper_.y1 - stepper_.last_stage()).head(n).norm();
    const double change = (stepper_.end_rate() - stepper_.rates[stepper_.stages - 1]).head(n).norm();
    return apart > 0.0 ? change / apart : 0.0;
}

// Return the derivative of the rate along a unit direction. `force` receives that of the forces.
VecX StiffnessGuard::difference(System& system, double relative, const VecX& direction, VecX& force) {
    const double end = stepper_.t0 + stepper_.h;
    const int n = static_cast<int>(direction.size());
    const double step = relative * (1.0 + stepper_.y1.head(n).cwiseAbs().maxCoeff());
    VecX there[2], forces[2];
    for (int side = 0; side < 2; ++side) {
        probe_ = stepper_.y1;
        probe_.head(n) += (side == 0 ? step : -step) * direction;
        probe_rate_ = VecX::Zero(system.ny);
        system.derivative(end, probe_, probe_rate_);
        there[side] = probe_rate_.head(n);
        forces[side] = system.w.now.F;
        if (system.p.has_laws()) forces[side] += system.w.now.C;
    }
    force = (forces[0] - forces[1]) / (2.0 * step);
    return (there[0] - there[1]) / (2.0 * step);
}

StiffnessGuard::FastestMode StiffnessGuard::fastest_mode(System& system, double relative) {
    const int n = system.nq + system.nv + system.nz;
    VecX x = VecX::Ones(n).normalized(), force, other_force;
    for (int pass = 0; pass < parameters.power_passes; ++pass) x = difference(system, relative, x, force).normalized();
    // Largest eigenvalue in the plane of x and its image.
    const VecX image = difference(system, relative, x, force);
    VecX other = image - x.dot(image) * x;
    const double a = x.dot(image), c = other.norm();
    std::complex<double> eigenvalue = a;
    if (c > 1e-9 * image.norm()) {
        other /= c;
        const VecX other_image = difference(system, relative, other, other_force);
        const double b = x.dot(other_image), d = other.dot(other_image);
        const std::complex<double> root = std::sqrt(std::complex<double>(0.25 * (a - d) * (a - d) + b * c));
        const std::complex<double> one = 0.5 * (a + d) + root, two = 0.5 * (a + d) - root;
        eigenvalue = std::abs(one) > std::abs(two) ? one : two;
        if (force.norm() < other_force.norm()) {
            x = other;
            force = other_force;
        }
    }
    int dof = 0;
    const VecX power = force.cwiseAbs().cwiseProduct(x.segment(system.nq, system.nv).cwiseAbs());
    (power.maxCoeff() > 0.0 ? power : force.cwiseAbs()).eval().maxCoeff(&dof);
    return {-eigenvalue.real(), std::abs(eigenvalue.imag()), dof};
}

StiffnessGuard::FastestMode StiffnessGuard::mode_here() {
    const Program& p = system_.p;
    const Workspace& run = system_.w;
    Workspace w(p);
    w.state = run.state;
    w.continues = run.continues;
    w.now.not_before = run.now.not_before;
    w.now.not_after = run.now.not_after;
    w.now.has_override = run.now.has_override;
    w.now.override_torque = run.now.override_torque;
    select_rows(p, w);
    static_cast<RowChoice&>(w.now.rows) = run.now.rows;
    System system(p, w, false);
    return fastest_mode(system, parameters.difference_step);
}

void StiffnessGuard::check_step() {
    if (stepper_.method.stability == 0.0 || stepper_.collocates()) return;
    check_stability_limit();
    if (++steps_ == next_estimate_steps_) estimate_remaining_time();
}

void StiffnessGuard::check_stability_limit() {
    const double border = stepper_.method.stability, size = stepper_.h, end = stepper_.t0 + size;
    if (!(options_.end() - end > max_steps_ * size)) return;
    if (size * stage_rate() < parameters.near_border * border) {
        if (++progress_.quiet_steps == parameters.quiet_steps) progress_.stiff_steps = 0;
        return;
    }
    progress_.quiet_steps = 0;
    if (++progress_.stiff_steps < parameters.suspicious_steps) return;
    progress_.stiff_steps = 0;
    const FastestMode mode = mode_here();
    if (size * mode.rate() > parameters.near_border * border && mode.decays())
        throw Failure(Failure::Kind::stiff, end, {mode.dof}, mode.rate());
}

void StiffnessGuard::estimate_remaining_time() {
    next_estimate_steps_ = 2 * steps_;
    const double size = stepper_.h, end = stepper_.t0 + size, left = options_.end() - end;
    const double so_far = std::chrono::duration<double>(Clock::now() - start_time_).count();
    if (so_far / static_cast<double>(steps_) * (left / size) < parameters.long_time) return;
    const FastestMode mode = mode_here();
    const double radians = size * mode.rate();
    const bool follows =
        mode.decays() ? radians > parameters.near_border * stepper_.method.stability && left < max_steps_ * size
                      : radians > parameters.part_of_period && mode.rate() * left > parameters.many_radians;
    if (!follows) return;
    next_estimate_steps_ = parameters.no_estimate_steps;
    options_.hint(end, mode.dof, mode.rate(), mode.decays());
}

void StiffnessGuard::require_time_steps(double size) {
    // Time stepping solves for slip directions together with the forces, so slow slip may turn arbitrarily fast.
    system_.w.state.solves_directions = true;
    const FastestMode mode = fastest_mode(system_, parameters.difference_step);
    if (!(size * mode.rate() > parameters.euler_border && mode.decays())) return;
    const double shorter = fastest_mode(system_, parameters.shorter_step).rate();
    if (shorter < parameters.same_rate * mode.rate() || mode.rate() < parameters.same_rate * shorter) return;
    throw Failure(Failure::Kind::stiff, stepper_.t0 + stepper_.h, {mode.dof}, mode.rate());
}

}  // namespace pn
