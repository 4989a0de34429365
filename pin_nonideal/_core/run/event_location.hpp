// Where an event lies inside a step.
//
// The search on the interpolant gives the first guess of the instant; the step is then taken again up to there, so that an
// event is as accurate as a step, and its end moved by what the margin is there.
#pragma once

#include <optional>
#include <vector>

#include "friction/modes.hpp"
#include "run/event_search.hpp"

namespace pn {

struct FoundEvent {
    enum class Kind {
        rest_or_limit,      // an element has come to rest, or what sticks has reached its limit
        released_together,  // redundant elements at rest cannot hold any longer, this one among them
        reversal,           // the slip of an element has turned without coming to rest
        pull,               // a contact begins to pull
    } kind;
    int index;  // of the friction element, or of the contact that pulls
    double time;

    bool changes_modes() const { return kind == Kind::rest_or_limit || kind == Kind::released_together; }
};

class EventLocator {
public:
    // Slip speed of each element of several directions when its step began, and whether each contact pulls by then.
    EventLocator(System& system, Stepper& stepper, const std::vector<double>& slip_at_start,
                 const std::vector<char>& pulls);

    // Ends the step just taken at its first event; the workspace is evaluated at the step's end either way.
    std::optional<FoundEvent> locate();

    // Fixed steps shrink toward the rest of a slip of several directions, whose direction may turn fast at the end. The
    // workspace must be evaluated at the step's start.
    double shorten_toward_rest(const VecX& rate, double size);

private:
    bool has_arrived(int element) const;
    bool passes_by_rest(int element) const;

    double margin_at_end(const Watch& watch);
    void end_step_at(double size);
    void correct_end_to(double size, double full);
    void step_onto(const Crossing& crossing);

    bool can_hold(const std::vector<Mode>& modes, ModeQuestion& asked);
    std::optional<FoundEvent> release_together();

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    const std::vector<double>& slip_at_start_;
    EventSearch search_;
};

}  // namespace pn
