// What a run tells of its motion where no mode changes: contacts that are kept though they pull, and where the laws begin
// to allow other motions too.
#pragma once

#include <optional>

#include "run/output/checkpoint.hpp"
#include "run/events/event_location.hpp"

namespace pn {

class Notices {
public:
    Notices(System& system, Stepper& stepper, Progress& progress, Recording& out);

    // Contacts and wheels that have to pull, told once each time they begin.
    void pulls(const std::optional<FoundEvent>& event) {
        if (!p.contacts.empty()) tell_pulls(event);
    }
    // Where the laws begin to allow other motions too, or none at the end of a step of time stepping, told once each time;
    // returns when, where that lies inside the step.
    std::optional<double> several(bool after_step) {
        const bool before = progress_.several;
        progress_.several = w.state.unique == Uniqueness::several || w.now.several || w.now.no_motion;
        if (before || !progress_.several) return std::nullopt;
        return begin_several(after_step);
    }

private:
    void tell_pulls(const std::optional<FoundEvent>& event);
    std::optional<double> begin_several(bool after_step);
    double last_unique();

    const Program& p;
    Workspace& w;
    System& system_;
    Stepper& stepper_;
    Progress& progress_;
    Recording& out_;
    VecX sample_;
};

}  // namespace pn
