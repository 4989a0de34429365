// Where an event lies inside a step.
//
// The search on the interpolant gives the first guess of the instant; the step is then taken again up to there, so that an
// event is as accurate as a step, and its end is moved by the remaining margin. Toward a rest of slip in several
// directions a step that does not reach it within the tolerance ends before it, and a shorter one follows.
#pragma once

#include <optional>
#include <vector>

#include "friction/stick_slip.hpp"
#include "run/events/event_search.hpp"

namespace pn {

struct FoundEvent {
    enum class Kind {
        rest_or_limit,      // an element has come to rest, or what sticks has reached its limit
        released_together,  // redundant elements at rest cannot hold any longer, this one among them
        reversal,           // the slip of an element has turned without coming to rest
        pull,               // a contact that is kept begins to pull
        lift,               // one that may open carries nothing any more, or several together cannot press
        touch,              // a gap closes
        user,               // a function of the user crosses zero
    } kind;
    int index;  // of the friction element, of the contact that pulls, or of the gap; -1 for several gaps
    double time;

    bool changes_modes() const { return kind != Kind::reversal && kind != Kind::pull && kind != Kind::user; }
    bool of_gap() const { return kind == Kind::lift || kind == Kind::touch; }
};

class EventLocator {
public:
    // Slip speed of each element of several directions when its step began, and whether each contact pulls by then.
    EventLocator(System& system, Stepper& stepper, ErrorNorm& norm, const std::vector<double>& slip_at_start,
                 const std::vector<char>& pulls, GapWatch& watch);

    // Ends the step just taken at its first event; the workspace is evaluated at the step's end either way.
    std::optional<FoundEvent> locate();
    // Time from the step's end to the rest of slip before which it was ended, if it was.
    std::optional<double> time_to_rest() const { return time_to_rest_; }

    // Fixed steps shrink toward the rest of a slip of several directions, whose direction may turn fast at the end. The
    // workspace must be evaluated at the step's start.
    double shorten_toward_rest(const VecX& rate, double size);

private:
    bool has_arrived(int element) const;
    bool passes_by_rest(int element) const;
    bool misses_rest(const Watch& watch) const;

    double margin_at_end(const Watch& watch);
    void end_step_at(double size);
    void correct_end_to(double size);
    void step_onto(const Crossing& crossing);
    void correct_instant(const Crossing& crossing, double full);
    void end_before_rest();

    std::optional<double> release_rate(double t, const VecX& y, const std::vector<Mode>& modes, ModeQuestion& asked);
    std::optional<double> release_rate_at_end(const std::vector<Mode>& modes, ModeQuestion& asked);
    double release_part(double rate, const std::vector<Mode>& modes, ModeQuestion& asked);
    std::optional<double> release_rate_inside(const std::vector<Mode>& modes, ModeQuestion& asked);
    std::optional<FoundEvent> release_together();
    bool all_press();
    std::optional<FoundEvent> lift_together();

    System& system_;
    Stepper& stepper_;
    ErrorNorm& norm_;
    const Program& p;
    Workspace& w;
    const std::vector<double>& slip_at_start_;
    EventSearch search_;
    std::optional<double> time_to_rest_;
};

}  // namespace pn
