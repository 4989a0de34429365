// Where an event lies inside a step.
//
// A slipping element watches its slip velocity, a sticking one its multiplier against the static limit, a contact its
// normal force. The interpolant gives the first guess of the instant; the step is then taken again up to there and the
// guess corrected by Newton's or the secant method, so that an event is as accurate as a step.
#pragma once

#include <optional>
#include <vector>

#include "friction/modes.hpp"
#include "run/stepper.hpp"

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
    // What may cross zero inside the step: the margin of an element that slips or sticks, or of a contact.
    struct Watch {
        enum class Kind { slip, stick, contact } kind;
        int index;
    };

    bool has_arrived(int element) const;
    bool may_reach_limit(int element);
    bool may_stop(int element) const;
    bool dips(int element, double noise) const;
    double time_of(int stage) const;
    bool passes_by_rest(int element) const;
    std::vector<Watch> crossed();

    double margin(const Watch& watch, double t, const VecX& y);
    double margin_at_end(const Watch& watch);
    bool known_rate(const Watch& watch) const;
    double margin_rate(const Watch& watch, double size, double here, double full);
    double first_crossing(const Watch& watch);
    void end_step_at(double size);
    void step_onto(const Watch& watch, double part);

    bool can_hold(const std::vector<Mode>& modes, ModeQuestion& asked);
    std::optional<FoundEvent> release_together();

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    const std::vector<double>& slip_at_start_;
    const std::vector<char>& pulls_;
    std::vector<int> by_time_;  // stages before the step's end, and that end
    VecX probe_, probe_rate_;
};

}  // namespace pn
