// Events at sign changes of values: user functions, and the remaining effort of drives.
//
// A step is sampled on the method's own interpolant, at its end and at places inside. The inner samples detect values
// that cross zero and return. The step is repeated up to the first crossing, and its end is corrected until the value
// there is zero. An event is therefore as accurate as a step.
#pragma once

#include <vector>

#include "run/output/checkpoint.hpp"
#include "run/options.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

struct ValueEventsParameters {
    int samples = 5;           // samples of each step
    int max_corrections = 12;  // maximum secants for the end of the step
    // Tolerance of the corrected end, relative to the step.
    double end_tolerance = 1e-14;
    // Maximum time difference of a friction event and a user event that coincide, relative to the step.
    double same_part = 1e-12;
    // Shortest step up to an event, in floating-point spacings of the time.
    double start_spacings = 8.0;
};

class ValueEvents {
public:
    using Parameters = ValueEventsParameters;
    static constexpr Parameters parameters{};

    ValueEvents(const std::vector<UserEvent>& events_in, System& system, Stepper& stepper, Progress& progress);

    bool empty() const { return count_.empty(); }
    // Store the signs at the start of a run.
    void start(double t, const VecX& y);
    // Search the step just taken, which may end at a friction event, and end it at the first value event. Return true
    // if its end has changed. The workspace must be evaluated at the step's end, also on return.
    bool locate(bool ends_at_event);
    // Count the events at the end of a step of time stepping, whose end stays.
    void sample_end(double t, const VecX& y);
    // Values with an event at the end of the step. `append_events` appends their events.
    const std::vector<int>& found() const { return found_; }
    void append_events(double t, std::vector<Event>& events) const;
    // Check if an event has ended the run.
    bool ends_run() const { return ends_run_; }

private:
    int users() const { return static_cast<int>(events_.size()); }
    int size() const { return static_cast<int>(count_.size()); }
    double value(int k, double t, const VecX& y);
    double effort_left(int dof, double t, const VecX& y);
    double value_inside(int k, double part);
    int direction(int k) const { return k < users() ? events_[k].direction : 0; }
    bool counts(int k) const { return direction(k) == 0 || direction(k) == -side_[k]; }
    // Return the fraction of the step at which value k first crosses zero, `beyond` if it does not.
    double first_crossing(int k);
    void end_step_at(double size);
    void step_onto(int k, double part);
    void store_signs();
    void count(int k);

    const std::vector<UserEvent>& events_;
    System& system_;
    Stepper& stepper_;
    std::vector<int> drives_;     // dofs with bounded effort, their values follow the user's values
    std::vector<double>& side_;   // current sign of each value, 0 if zero since the start
    std::vector<long> count_;
    // Demanded effort of all drives, cached for the last state.
    bool has_demand_ = false;
    double demand_time_ = 0.0;
    VecX demand_y_, demanded_torque_;
    std::vector<int> found_;
    bool ends_run_ = false;
    VecX probe_;
};

}  // namespace pn
