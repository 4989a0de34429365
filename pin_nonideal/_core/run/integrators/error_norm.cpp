#include "run/integrators/error_norm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/projection.hpp"
#include "math/tolerances.hpp"
#include "tree/lie_group.hpp"

namespace pn {

ErrorNorm::ErrorNorm(System& system, double rtol, const VecX& atol, const VecX& rounding)
    : system_(system), rtol_(rtol), atol_(atol), tolerance_(VecX::Zero(2 * system.nv + system.nz)),
      tangent_(tolerance_), rounding_(rounding) {}

void ErrorNorm::magnitude(const VecX& y) {
    const auto raise = [&](int k, double size) { tolerance_[k] = std::max(tolerance_[k], size); };
    for (const Chart& c : system_.p.mechanism.charts) {
        const int lengths = c.kind == Chart::Kind::pose ? 3 : c.kind == Chart::Kind::plane ? 2 : 0;
        const int n = c.kind == Chart::Kind::vector ? c.n : c.kind == Chart::Kind::pose ? 6
                      : c.kind == Chart::Kind::circle ? 1 : 3;
        for (int k = 0; k < n; ++k) {  // an angle of a rotation counts as one radian
            const bool plain = c.kind == Chart::Kind::vector || k < lengths;
            raise(c.iv + k, plain ? std::abs(y[c.iq + k]) : 1.0);
        }
    }
    const int nq = system_.nq, nv = system_.nv;
    for (int k = 0; k < nv + system_.nz; ++k) raise(nv + k, std::abs(y[nq + k]));
}

void ErrorNorm::set_tolerances(const VecX& y0, const VecX& y1, double h) {
    tolerance_.setZero();
    magnitude(y0);
    magnitude(y1);
    auto velocities = tolerance_.segment(system_.nv, system_.nv);
    const double rounding = parameters.velocity_rounding * velocities.maxCoeff();
    tolerance_ = atol_ + rtol_ * tolerance_;
    velocities = velocities.cwiseMax(rounding);
    limited_ = false;
    const int nv = system_.nv;
    for (int k = 0; k < static_cast<int>(rounding_.size()); ++k) {
        // Positions integrate the velocities of the stages, which have the rounding error of accelerations over the step.
        const double rate = rounding_[k] + (k < nv ? std::abs(h) * rounding_[nv + k] : 0.0);
        const double floor = std::abs(h) * rate;
        limited_ |= floor > tolerance_[k];
        tolerance_[k] = std::max(tolerance_[k], floor);
    }
    resolves_shares_ = std::abs(h) >= parameters.min_resolved_step;
    share_rounding_ = parameters.stuck_force_rounding * std::abs(h) * system_.w.now.F.cwiseAbs().maxCoeff();
    share_tolerance_ = parameters.share_part * std::max(std::abs(h), parameters.min_resolved_step);
}

void ErrorNorm::to_tangent(const VecX& dy, const VecX& y) {
    const int nq = system_.nq, nv = system_.nv, nz = system_.nz;
    ambient_to_tangent(system_.p.mechanism, y.data(), dy.data(), tangent_.data());
    tangent_.segment(nv, nv + nz) = dy.segment(nq, nv + nz);
}

void ErrorNorm::raise(VecX& rounding, const VecX& dy, const VecX& y) {
    to_tangent(dy, y);
    rounding = rounding.cwiseMax(tangent_.cwiseAbs());
}

double ErrorNorm::operator()(const VecX& dy, const VecX& y) {
    const int nv = system_.nv, nz = system_.nz;
    int n = 2 * nv + nz;
    to_tangent(dy, y);
    if (system_.on_constraints) {
        // The projection at the step's end removes motion against the rows. Near a singular position this motion is
        // noise.
        remove_normal_move(system_.p, system_.w, tangent_.head(nv));
        remove_normal_velocity(system_.p, system_.w, tangent_.segment(nv, nv));
    }
    double sum = 0.0;
    for (int k = 0; k < 2 * nv + nz; ++k) {
        const double x = tangent_[k] / tolerance_[k];
        sum += x * x;
    }
    for (int e : system_.w.now.loaded_elements) {
        if (system_.w.state.mode[e] != sticking) continue;
        // The load of a contact can jump at an edge. Steps too short to resolve the jump omit this load.
        if (system_.p.frictions[e].gap >= 0 && !resolves_shares_) continue;
        const double limit = std::max(system_.w.now.load[e].reach(), min_scale);
        const double x = system_.share(dy, e) / std::max(share_tolerance_, share_rounding_ / limit);
        sum += x * x;
        ++n;
    }
    return std::sqrt(sum / n);
}

double ErrorNorm::of_speed(double speed) const {
    return speed / tolerance_.segment(system_.nv, system_.nv).maxCoeff();
}

double ErrorNorm::of_projection(const VecX& dy, const VecX& y0, const VecX& y1, double t, double h) {
    to_tangent(dy, y0);
    const int nv = system_.nv, n = system_.on_constraints ? nv : 2 * nv;
    const double time_rounding = parameters.time_spacings * std::numeric_limits<double>::epsilon() * std::abs(t);
    const double speed = system_.velocity(y1).cwiseAbs().maxCoeff();
    const double acceleration = (system_.velocity(y1) - system_.velocity(y0)).cwiseAbs().maxCoeff() / std::abs(h);
    double sum = 0.0;
    const auto add = [&](int first, double open, double rounding) {
        if (open < parameters.residual_spacings) return;
        for (int k = first; k < first + nv; ++k)
            if (std::abs(tangent_[k]) > rounding) sum += std::pow(tangent_[k] / tolerance_[k], 2);
    };
    add(0, system_.w.now.projected_gap, time_rounding * speed);
    if (n > nv) add(nv, system_.w.now.projected_rate, time_rounding * acceleration);
    return std::sqrt(sum / n);
}

double ErrorNorm::initial_step(int order, double t, const VecX& y, const VecX& dy, double limit) {
    set_tolerances(y, y, 1.0);
    VecX plain = y, probe = y, rate = y;
    for (const Chart& c : system_.p.mechanism.charts)
        if (c.kind != Chart::Kind::vector) plain.segment(c.iq, 1).setZero();
    const double size = (*this)(plain, y), speed = (*this)(dy, y);
    double trial = size < parameters.nothing || speed < parameters.nothing ? parameters.smallest_trial
                                                                           : parameters.first_part * size / speed;
    trial = std::min(trial, limit);
    probe = y + trial * dy;
    system_.normalize(probe);
    system_.derivative(t + trial, probe, rate);
    rate -= dy;
    const double curvature = (*this)(rate, y) / trial, top = std::max(speed, curvature);
    const double step = top <= parameters.no_curvature ? std::max(parameters.smallest_trial, trial * parameters.flat_part)
                                            : std::pow(parameters.first_part / top, 1.0 / order);
    return std::min({parameters.max_trial_growth * trial, step, limit});
}

}  // namespace pn
