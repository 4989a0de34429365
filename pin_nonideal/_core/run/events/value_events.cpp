#include "run/events/value_events.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/given_forces.hpp"
#include "math/roots.hpp"

namespace pn {

namespace {

double sign(double x) { return (x > 0.0) - (x < 0.0); }

// Return the dofs with bounded drive effort.
std::vector<int> bounded_drives(const Program& p) {
    std::vector<int> dofs;
    for (int dof = 0; p.limits_effort() && dof < p.mechanism.nv; ++dof)
        if (p.min_effort[dof] > -HUGE_VAL || p.max_effort[dof] < HUGE_VAL) dofs.push_back(dof);
    return dofs;
}

}  // namespace

ValueEvents::ValueEvents(const std::vector<UserEvent>& events_in, System& system, Stepper& stepper, Progress& progress)
    : events_(events_in), system_(system), stepper_(stepper), drives_(bounded_drives(system.p)), side_(progress.event_signs),
      count_(events_in.size() + drives_.size(), 0), demand_y_(VecX::Zero(system.ns)),
      demanded_torque_(VecX::Zero(system.nv)), probe_(VecX::Zero(system.ny)) {
    side_.assign(count_.size(), 0.0);
}

double ValueEvents::value(int k, double t, const VecX& y) {
    if (k >= users()) return effort_left(drives_[k - users()], t, y);
    system_.read(y);
    return events_[k].function(t, system_.q, system_.v);
}

// Return the effort left in a drive, negative if the demand exceeds it. The demands of all drives are computed at once.
double ValueEvents::effort_left(int dof, double t, const VecX& y) {
    if (!has_demand_ || t != demand_time_ || demand_y_ != y.head(system_.ns)) {
        has_demand_ = true;
        demand_time_ = t;
        demand_y_ = y.head(system_.ns);
        system_.read(y);
        demanded_torque(system_.p, system_.w, t, system_.q, system_.v, demanded_torque_);
    }
    return std::min(system_.p.max_effort[dof] - demanded_torque_[dof], demanded_torque_[dof] - system_.p.min_effort[dof]);
}

double ValueEvents::value_inside(int k, double part) {
    if (part >= 1.0) return value(k, stepper_.t0 + stepper_.h, stepper_.y1);
    stepper_.interpolate(part, probe_);
    return value(k, stepper_.t0 + part * stepper_.h, probe_);
}

void ValueEvents::start(double t, const VecX& y) {
    has_demand_ = false;
    for (int k = 0; k < size(); ++k) side_[k] = sign(value(k, t, y));
}

// A value that is zero at the start of a run has no sign. The first sign of such a value is not an event.
double ValueEvents::first_crossing(int k) {
    double before = 0.0;
    for (int i = 1; i <= parameters.samples; ++i) {
        const double part = static_cast<double>(i) / parameters.samples, sample = value_inside(k, part);
        if (side_[k] != 0 && sign(sample) == -side_[k]) {
            if (counts(k)) {
                const auto margin = [&](double x) { return side_[k] * value_inside(k, x) / std::abs(sample); };
                const double at_start = margin(before);
                if (before == 0.0 && at_start <= 0.0) return root_after_start(part, -1.0, 0.0, margin);
                return root_between(before, at_start, part, -1.0, margin);
            }
            side_[k] = sign(sample);
        } else if (side_[k] == 0) {
            side_[k] = sign(sample);
        }
        before = part;
    }
    return no_crossing;
}

void ValueEvents::end_step_at(double size) {
    stepper_.repeat(size);
    system_.project_and_evaluate(stepper_.t0 + size, stepper_.y1, stepper_.end_rate());
}

// Repeat the step up to a crossing. Secants correct its length, starting with the slope of the interpolant at the
// crossing.
void ValueEvents::step_onto(int k, double part) {
    const double full = stepper_.h, t0 = stepper_.t0;
    const double min_size = parameters.start_spacings * (std::nextafter(std::abs(t0), HUGE_VAL) - std::abs(t0));
    const double low = std::max(0.0, part - root_search_parameters.margin_slope_step),
                 high = std::min(1.0, part + root_search_parameters.margin_slope_step);
    double slope = (value_inside(k, high) - value_inside(k, low)) / ((high - low) * full);
    double size = std::max(part * full, min_size);
    end_step_at(size);
    double end_value = value(k, t0 + size, stepper_.y1);
    for (int i = 0; i < parameters.max_corrections && end_value != 0.0 && slope != 0.0; ++i) {
        const double next = std::clamp(size - end_value / slope, min_size, full), change = next - size, before = end_value;
        if (std::abs(change) <= parameters.end_tolerance * full || t0 + next == t0 + size) break;
        end_step_at(size = next);
        end_value = value(k, t0 + size, stepper_.y1);
        slope = (end_value - before) / change;
    }
}

void ValueEvents::append_events(double t, std::vector<Event>& events) const {
    for (int k : found_) {
        const Event::Kind drives = side_[k] < 0.0 ? Event::Kind::saturate : Event::Kind::desaturate;
        if (k < users()) events.push_back({t, Event::Kind::user, k});
        else events.push_back({t, drives, drives_[k - users()]});
    }
}

void ValueEvents::count(int k) {
    const int after = direction(k);
    side_[k] = after != 0 ? after : -side_[k];
    found_.push_back(k);
    ++count_[k];
    ends_run_ |= k < users() && events_[k].terminal > 0 && count_[k] >= events_[k].terminal;
}

// Count events that coincide with the event at the step's end, and store the signs of all other values.
void ValueEvents::store_signs() {
    for (int k = 0; k < size(); ++k) {
        const double end_sign = sign(value(k, stepper_.t0 + stepper_.h, stepper_.y1));
        if (end_sign == 0 || end_sign == side_[k] || std::count(found_.begin(), found_.end(), k) > 0) continue;
        if (side_[k] != 0 && counts(k)) count(k);
        else side_[k] = end_sign;
    }
}

bool ValueEvents::locate(bool ends_at_event) {
    found_.clear();
    stepper_.make_interpolant();
    const std::vector<double> side = side_;
    has_demand_ = false;
    int first = -1;
    double part = no_crossing;
    for (int k = 0; k < size(); ++k) {
        const double crossing = first_crossing(k);
        if (crossing >= part) continue;
        part = crossing;
        first = k;
    }
    side_ = side;
    const bool at_end = ends_at_event && part > 1.0 - parameters.same_part;
    if (first >= 0) count(first);
    if (first >= 0 && !at_end) {
        step_onto(first, part);
    } else {
        stepper_.end_directions();
        system_.read(stepper_.y1);
        system_.read_law_states(stepper_.y1);
        evaluate(system_.p, system_.w, stepper_.t0 + stepper_.h, system_.q, system_.v);
    }
    store_signs();
    return first >= 0 && !at_end;
}

void ValueEvents::sample_end(double t, const VecX& y) {
    found_.clear();
    has_demand_ = false;
    for (int k = 0; k < size(); ++k) {
        const double end_sign = sign(value(k, t, y));
        if (end_sign == 0 || end_sign == side_[k]) continue;
        if (side_[k] != 0 && counts(k)) count(k);
        else side_[k] = end_sign;
    }
}

}  // namespace pn
