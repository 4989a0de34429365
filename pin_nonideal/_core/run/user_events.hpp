// Events that functions of the user tell by a change of sign.
//
// A step is looked at on the method's own interpolant, at its end and at places inside, so that what crosses zero and
// comes back is met as well. It is taken again up to the first crossing, and its end moved until the value there is zero:
// an event is as accurate as a step.
#pragma once

#include <vector>

#include "run/options.hpp"
#include "run/stepper.hpp"

namespace pn {

class UserEvents {
public:
    UserEvents(const std::vector<UserEvent>& asked, System& system, Stepper& stepper);

    bool empty() const { return asked_.empty(); }
    // Signs at the start of a run.
    void start(double t, const VecX& y);
    // Looks at the step just taken, which may end at an event of friction, and ends it at the first event in it; whether
    // it ends at another time now. The workspace must be evaluated at its end, and is so again.
    bool locate(bool ends_at_event);
    // The same for a step of time stepping, which stays as it is.
    void look_at_end(double t, const VecX& y);
    // Events at the end of the step.
    const std::vector<int>& found() const { return found_; }
    void tell(double t, std::vector<Event>& events) const;
    // Whether one of them ends the run.
    bool ends_run() const { return ends_run_; }

private:
    double value(int k, double t, const VecX& y);
    double value_inside(int k, double part);
    bool counts(int k) const { return asked_[k].direction == 0 || asked_[k].direction == -side_[k]; }
    // Part of the step at which this one first happens, beyond it where it does not.
    double first_crossing(int k);
    void end_step_at(double size);
    void step_onto(int k, double part);
    void take_signs();
    void count(int k);

    const std::vector<UserEvent>& asked_;
    System& system_;
    Stepper& stepper_;
    std::vector<signed char> side_;  // sign of each value by now; 0 where it has been zero since the start
    std::vector<long> count_;
    std::vector<int> found_;
    bool ends_run_ = false;
    VecX probe_;
};

}  // namespace pn
