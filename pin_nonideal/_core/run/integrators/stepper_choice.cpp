#include "run/integrators/stepper_choice.hpp"

#include "run/events/events.hpp"

namespace pn {

namespace {

// Relaxation rate of slip directions, times the step, from which stability limits explicit methods (at 3 to 6).
// Collocation begins after `stiff_in_a_row` such steps. After collocation ends, the count begins again `patience` steps
// later.
constexpr double stiff_rate = 2.5;
constexpr int stiff_in_a_row = 6, patience = 20;

}  // namespace

StepperChoice::StepperChoice(System& system, Stepper& stepper, Progress& progress, const Options& options)
    : w(system.w), system_(system), stepper_(stepper), progress_(progress), options_(options) {}

void StepperChoice::look() {
    is_stiff_ = options_.method.adaptive() && turning(system_) && stepper_.stiffness() > stiff_rate;
}

void StepperChoice::choose() {
    stepper_.forget();
    bool& seeks = w.state.seeks_directions;
    int& turning_steps = progress_.turning_steps;
    const double next = options_.method.adaptive() ? progress_.h : options_.dt;
    if (stepper_.collocates()) {
        seeks = turning(system_) && (stepper_.h == 0.0 || stepper_.stiffness() * next > stiff_rate * stepper_.h);
        turning_steps = seeks ? 0 : -patience;
    } else if (turning_steps < 0) {
        ++turning_steps;
    } else {
        turning_steps = is_stiff_ ? turning_steps + 1 : 0;
        seeks |= turning_steps == stiff_in_a_row;
    }
}

}  // namespace pn
