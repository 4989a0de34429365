// Events of a run without a mode change: bilateral contacts in tension, and instants from which the laws allow several
// motions.
#pragma once

#include <optional>

#include "run/output/checkpoint.hpp"
#include "run/events/event_location.hpp"

namespace pn {

class Warnings {
public:
    Warnings(System& system, Stepper& stepper, Progress& progress, Recording& out);

    // Record contacts and wheels in tension, once each time the tension begins.
    void check_tension(const std::optional<FoundEvent>& event) {
        if (!p.contacts.empty()) record_pulls(event);
    }
    // Record the instant from which the laws allow several motions, once each time. At the end of a time step this
    // includes laws that allow no motion. Return the recorded instant, which can lie inside the step.
    std::optional<double> check_uniqueness(bool after_step) {
        const bool before = progress_.several_motions;
        progress_.several_motions = w.state.unique == Uniqueness::several || w.now.several || w.now.no_motion;
        if (before || !progress_.several_motions) return std::nullopt;
        return record_several(after_step);
    }

private:
    void record_pulls(const std::optional<FoundEvent>& event);
    std::optional<double> record_several(bool after_step);
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
