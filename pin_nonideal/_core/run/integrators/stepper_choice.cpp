#include "run/integrators/stepper_choice.hpp"

#include "run/events/mode_selection.hpp"

namespace pn {

StepperChoice::StepperChoice(System& system, Stepper& stepper, Progress& progress, const Options& options)
    : w(system.w), system_(system), stepper_(stepper), progress_(progress), options_(options) {}

void StepperChoice::check_step() {
    is_stiff_ = options_.method.adaptive() && has_turning_slip(system_) && stepper_.stiffness() > parameters.stiff_rate;
}

void StepperChoice::choose() {
    stepper_.reset_warm_start();
    bool& seeks = w.state.solves_directions;
    int& turning_steps = progress_.turning_steps;
    const double next = options_.method.adaptive() ? progress_.h : options_.dt;
    if (stepper_.collocates()) {
        seeks = has_turning_slip(system_) &&
                (stepper_.h == 0.0 || stepper_.stiffness() * next > parameters.stiff_rate * stepper_.h);
        turning_steps = seeks ? 0 : -parameters.patience;
    } else if (turning_steps < 0) {
        ++turning_steps;
    } else {
        turning_steps = is_stiff_ ? turning_steps + 1 : 0;
        seeks |= turning_steps == parameters.stiff_in_a_row;
    }
}

}  // namespace pn
