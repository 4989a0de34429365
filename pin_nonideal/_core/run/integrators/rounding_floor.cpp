#include "run/integrators/rounding_floor.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/evaluation.hpp"
#include "run/integrators/step_control.hpp"

namespace pn {

namespace {

// Generator of random changes of the last digits of a state. The sequence is fixed, so that runs repeat.
// `max_spacings`: maximum change in floating-point spacings.
constexpr unsigned long long multiplier = 6364136223846793005ULL, increment = 1442695040888963407ULL;
const double second_difference = std::sqrt(6.0);  // standard deviation of its rounding, relative to that of a rate

}  // namespace

RoundingFloor::RoundingFloor(System& system, Stepper& stepper, ErrorNorm& norm, Progress& progress, Recording& out)
    : system_(system), stepper_(stepper), norm_(norm), progress_(progress), out_(out) {
    const Method& method = stepper.method;
    progress.rounding = VecX::Zero(2 * system.nv + system.nz);
    if (!method.E) return;
    double sum = 0.0;
    for (int i = 0; i < method.stages + method.first_same_as_last; ++i) sum += method.E[i] * method.E[i];
    tolerance_factor_ = parameters.sample_factor * std::sqrt(sum) / StepControl::aim(method);
}

// Measure the rounding error of the rates. Changes of the last digits of the state alter the rounding error of all
// operations. Opposite changes of the state give opposite changes of the rates, except for rounding. The second difference
// of the rates has 1 + 1 + 4 times the variance of the rounding error of one rate.
void RoundingFloor::measure() {
    const double end = stepper_.t0 + stepper_.h, epsilon = std::numeric_limits<double>::epsilon();
    const RunState kept = system_.w.state;
    const int n = system_.nq + system_.nv;
    const double size = system_.velocity(stepper_.end_rate()).cwiseAbs().maxCoeff();
    unsigned long long draw = 1;
    change_.resize(n), rate_.resize(stepper_.y1.size());
    progress_.rounding *= parameters.lasting_part;
    for (int sample = 0; sample < parameters.samples; ++sample) {
        for (int k = 0; k < n; ++k) {
            draw = multiplier * draw + increment;
            const double part = static_cast<double>(static_cast<long long>(draw)) * 0x1p-63;
            change_[k] = parameters.max_spacings * epsilon * part * stepper_.y1[k];  // zero entries stay zero
        }
        noise_ = -2.0 * stepper_.end_rate();
        for (const double side : {1.0, -1.0}) {
            probe_ = stepper_.y1;
            probe_.head(n) += side * change_;
            system_.normalize(probe_);
            system_.derivative(end, probe_, rate_);
            system_.w.state = kept;
            noise_ += rate_;
        }
        noise_ /= second_difference;
        norm_.raise(progress_.rounding, tolerance_factor_ * noise_, stepper_.y1);
        if (size > 0.0)
            out_.rounding = std::max(out_.rounding, system_.velocity(noise_).cwiseAbs().maxCoeff() / size);
    }
    system_.read(stepper_.y1);
    system_.read_law_states(stepper_.y1);
    evaluate(system_.p, system_.w, end, system_.q, system_.v);
    system_.w.state = kept;
}

void RoundingFloor::check_step() {
    if (tolerance_factor_ == 0.0 || stepper_.collocates()) return;
    if (out_.steps < std::max(parameters.min_measured_steps, progress_.next_rounding_check)) return;
    progress_.next_rounding_check = out_.steps + parameters.steps_between_measurements;
    measure();
}

}  // namespace pn
