#include "run/user_events.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "math/roots.hpp"

namespace pn {

namespace {

constexpr int looks = 5;      // into each step
constexpr double beyond = 2.0;
constexpr int corrections = 12;
// Parts of the step: in which its end is found, and in which the slope of a value is taken.
constexpr double corrected_width = 1e-14, slope_part = 1e-4;
// Of the step: an event of friction and one of the user this near to each other are at one time.
constexpr double same_part = 1e-12;
// An event this near to the step's start, in spacings of the time, has happened there.
constexpr double start_spacings = 8.0;

signed char sign(double x) { return static_cast<signed char>((x > 0.0) - (x < 0.0)); }

}  // namespace

UserEvents::UserEvents(const std::vector<UserEvent>& asked, System& system, Stepper& stepper)
    : asked_(asked), system_(system), stepper_(stepper), side_(asked.size(), 0), count_(asked.size(), 0) {}

double UserEvents::value(int k, double t, const VecX& y) {
    system_.read(y);
    return asked_[k].function(t, system_.q, system_.v);
}

double UserEvents::value_inside(int k, double part) {
    if (part >= 1.0) return value(k, stepper_.t0 + stepper_.h, stepper_.y1);
    stepper_.interpolate(part, probe_);
    return value(k, stepper_.t0 + part * stepper_.h, probe_);
}

void UserEvents::start(double t, const VecX& y) {
    probe_ = y;
    for (size_t k = 0; k < asked_.size(); ++k) side_[k] = sign(value(k, t, y));
}

// Where a value is zero at the start of a run it has no sign before it takes one, which is no event.
double UserEvents::first_crossing(int k) {
    double before = 0.0;
    for (int i = 1; i <= looks; ++i) {
        const double part = static_cast<double>(i) / looks, here = value_inside(k, part);
        if (side_[k] != 0 && sign(here) == -side_[k]) {
            if (counts(k)) {
                const auto margin = [&](double x) { return side_[k] * value_inside(k, x) / std::abs(here); };
                const double at_start = margin(before);
                if (before == 0.0 && at_start <= 0.0) return root_after_start(part, -1.0, 0.0, margin);
                return root_between(before, at_start, part, -1.0, margin);
            }
            side_[k] = sign(here);
        } else if (side_[k] == 0) {
            side_[k] = sign(here);
        }
        before = part;
    }
    return beyond;
}

void UserEvents::end_step_at(double size) {
    stepper_.take(stepper_.t0, size);
    system_.project_and_evaluate(stepper_.t0 + size, stepper_.y1, stepper_.end_rate());
}

// Secants on the length of the step, from the slope that the interpolant has at the crossing.
void UserEvents::step_onto(int k, double part) {
    const double full = stepper_.h, t0 = stepper_.t0;
    const double least = start_spacings * (std::nextafter(std::abs(t0), HUGE_VAL) - std::abs(t0));
    const double low = std::max(0.0, part - slope_part), high = std::min(1.0, part + slope_part);
    double slope = (value_inside(k, high) - value_inside(k, low)) / ((high - low) * full);
    double size = std::max(part * full, least);
    end_step_at(size);
    double here = value(k, t0 + size, stepper_.y1);
    for (int i = 0; i < corrections && here != 0.0 && slope != 0.0; ++i) {
        const double next = std::clamp(size - here / slope, least, full), change = next - size, before = here;
        if (std::abs(change) <= corrected_width * full || t0 + next == t0 + size) break;
        end_step_at(size = next);
        here = value(k, t0 + size, stepper_.y1);
        slope = (here - before) / change;
    }
}

void UserEvents::tell(double t, std::vector<Event>& events) const {
    for (int k : found_) events.push_back({t, Event::Kind::user, k});
}

void UserEvents::count(int k) {
    const int after = asked_[k].direction;
    side_[k] = static_cast<signed char>(after != 0 ? after : -side_[k]);
    found_.push_back(k);
    ++count_[k];
    ends_run_ |= asked_[k].terminal > 0 && count_[k] >= asked_[k].terminal;
}

// Events that happen together with the one that the step ends at, and signs of all others.
void UserEvents::take_signs() {
    for (int k = 0; k < static_cast<int>(asked_.size()); ++k) {
        const signed char here = sign(value(k, stepper_.t0 + stepper_.h, stepper_.y1));
        if (here == 0 || here == side_[k] || std::count(found_.begin(), found_.end(), k) > 0) continue;
        if (side_[k] != 0 && counts(k)) count(k);
        else side_[k] = here;
    }
}

bool UserEvents::locate(bool ends_at_event) {
    found_.clear();
    stepper_.make_interpolant();
    const std::vector<signed char> side = side_;
    int first = -1;
    double part = beyond;
    for (int k = 0; k < static_cast<int>(asked_.size()); ++k) {
        const double crossing = first_crossing(k);
        if (crossing >= part) continue;
        part = crossing;
        first = k;
    }
    side_ = side;
    const bool at_end = ends_at_event && part > 1.0 - same_part;
    if (first >= 0) count(first);
    if (first >= 0 && !at_end) {
        step_onto(first, part);
    } else {
        stepper_.end_directions();
        system_.read(stepper_.y1);
        system_.read_law_states(stepper_.y1);
        evaluate(system_.p, system_.w, stepper_.t0 + stepper_.h, system_.q, system_.v);
    }
    take_signs();
    return first >= 0 && !at_end;
}

void UserEvents::look_at_end(double t, const VecX& y) {
    found_.clear();
    for (int k = 0; k < static_cast<int>(asked_.size()); ++k) {
        const signed char here = sign(value(k, t, y));
        if (here == 0 || here == side_[k]) continue;
        if (side_[k] != 0 && counts(k)) count(k);
        else side_[k] = here;
    }
}

}  // namespace pn
