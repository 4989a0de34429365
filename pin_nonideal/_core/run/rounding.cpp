#include "run/rounding.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "dynamics/evaluation.hpp"
#include "run/step_control.hpp"

namespace pn {

namespace {

// Rounding is measured after this many steps first and twice as many each time, but at most so many apart: four evaluations
// among hundreds.
constexpr long first_look = 8, most_apart = 64;
// What is measured is a bound, and most runs are far better than it: only those that take so many steps, as noise that asks
// for ever shorter ones makes them, are held to it.
constexpr long many_steps = 2000;
// A measurement is a sample: the rounding of another step may be so many times it, and is taken for half of what it was
// before at least.
constexpr double sample_factor = 3.0, lasting_part = 0.5;
// Changes of the last digits are a fixed sequence, so that runs repeat; each of so many spacings of the numbers at most.
constexpr unsigned long long multiplier = 6364136223846793005ULL, increment = 1442695040888963407ULL;
constexpr double most_spacings = 16.0;
constexpr int samples = 3;

}  // namespace

RoundingFloor::RoundingFloor(System& system, Stepper& stepper, ErrorNorm& norm, Progress& progress, Recording& out)
    : system_(system), stepper_(stepper), norm_(norm), progress_(progress), out_(out) {
    const Method& method = stepper.method;
    progress.rounding = VecX::Zero(2 * system.nv + system.nz);
    if (!method.E) return;
    double sum = 0.0;
    for (int i = 0; i < method.stages + method.first_same_as_last; ++i) sum += method.E[i] * method.E[i];
    raised_ = sample_factor * std::sqrt(sum) / StepControl::aim(method);
}

// What changes of the last digits of the state make of its rates: every rounding on the way is another then, and the rates
// differ by what the scene makes of them.
void RoundingFloor::measure() {
    const double at = stepper_.t0 + stepper_.h, epsilon = std::numeric_limits<double>::epsilon();
    const RunState kept = system_.w.state;
    const int n = system_.nq + system_.nv;
    const double size = system_.velocity(stepper_.end_rate()).cwiseAbs().maxCoeff();
    unsigned long long draw = 1;
    progress_.rounding *= lasting_part;
    for (int sample = 0; sample < samples; ++sample) {
        probe_ = stepper_.y1;
        for (int k = 0; k < n; ++k) {
            draw = multiplier * draw + increment;
            const double part = static_cast<double>(static_cast<long long>(draw)) * 0x1p-63;
            probe_[k] *= 1.0 + most_spacings * epsilon * part;  // what rests goes on resting
        }
        system_.normalize(probe_);
        noise_ = stepper_.end_rate();
        system_.derivative(at, probe_, noise_);
        system_.w.state = kept;
        noise_ -= stepper_.end_rate();
        if (out_.steps >= many_steps) norm_.raise(progress_.rounding, raised_ * noise_, stepper_.y1);
        if (size > 0.0)
            out_.rounding = std::max(out_.rounding, system_.velocity(noise_).cwiseAbs().maxCoeff() / size);
    }
    system_.read(stepper_.y1);
    system_.read_law_states(stepper_.y1);
    evaluate(system_.p, system_.w, at, system_.q, system_.v);
    system_.w.state = kept;
}

void RoundingFloor::look() {
    if (raised_ == 0.0 || stepper_.collocates() || out_.steps < progress_.next_look) return;
    progress_.next_look = out_.steps + std::clamp(out_.steps, first_look, most_apart);
    measure();
}

}  // namespace pn
