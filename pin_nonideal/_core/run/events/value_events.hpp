// Events that values tell by a change of sign: functions of the user, and what drives have left of their effort.
//
// A step is looked at on the method's own interpolant, at its end and at places inside, so that what crosses zero and
// comes back is met as well. It is taken again up to the first crossing, and its end moved until the value there is zero:
// an event is as accurate as a step.
#pragma once

#include <vector>

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class ValueEvents {
public:
    ValueEvents(const std::vector<UserEvent>& asked, System& system, Stepper& stepper, Progress& progress);

    bool empty() const { return count_.empty(); }
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
    int users() const { return static_cast<int>(asked_.size()); }
    int size() const { return static_cast<int>(count_.size()); }
    double value(int k, double t, const VecX& y);
    double effort_left(int dof, double t, const VecX& y);
    double value_inside(int k, double part);
    int direction(int k) const { return k < users() ? asked_[k].direction : 0; }
    bool counts(int k) const { return direction(k) == 0 || direction(k) == -side_[k]; }
    // Part of the step at which this one first happens, beyond it where it does not.
    double first_crossing(int k);
    void end_step_at(double size);
    void step_onto(int k, double part);
    void take_signs();
    void count(int k);

    const std::vector<UserEvent>& asked_;
    System& system_;
    Stepper& stepper_;
    std::vector<int> drives_;     // dofs whose effort is bounded: values behind those of the user
    std::vector<double>& side_;   // sign of each value by now; 0 where it has been zero since the start
    std::vector<long> count_;
    // What is asked of all drives where they were looked at last.
    bool asked_before_ = false;
    double asked_time_ = 0.0;
    VecX asked_y_, asked_torque_;
    std::vector<int> found_;
    bool ends_run_ = false;
    VecX probe_;
};

}  // namespace pn
