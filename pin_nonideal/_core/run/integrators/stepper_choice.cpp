#include "run/integrators/stepper_choice.hpp"

#include "run/events/events.hpp"

namespace pn {

namespace {

// Of the step: where directions of slip relax faster, stability holds the explicit methods short (at 3 to 6); it is
// believed after some steps in a row, and asked again some steps after it turned out otherwise.
constexpr double stiff = 2.5;
constexpr int stiff_in_a_row = 6, patience = 20;

}  // namespace

StepperChoice::StepperChoice(System& system, Stepper& stepper, Progress& progress, const Options& options)
    : w(system.w), system_(system), stepper_(stepper), now_(progress), options_(options) {}

void StepperChoice::look() {
    turns_stiffly_ = options_.method.adaptive() && turning(system_) && stepper_.stiffness() > stiff;
}

void StepperChoice::choose() {
    stepper_.forget();
    bool& seeks = w.state.seeks_directions;
    int& turning_steps = now_.turning_steps;
    const double next = options_.method.adaptive() ? now_.h : options_.dt;
    if (stepper_.collocates()) {
        seeks = turning(system_) && (stepper_.h == 0.0 || stepper_.stiffness() * next > stiff * stepper_.h);
        turning_steps = seeks ? 0 : -patience;
    } else if (turning_steps < 0) {
        ++turning_steps;
    } else {
        turning_steps = turns_stiffly_ ? turning_steps + 1 : 0;
        seeks |= turning_steps == stiff_in_a_row;
    }
}

}  // namespace pn
