// Location of the first zero crossing of a margin in a step just taken, among the candidates of event_candidates.hpp.
//
// The method's own interpolant locates the crossing. Slip uses interpolated velocities, which need no evaluation. Sticking
// uses the rate of the integrated force / limit ratio, which one or two evaluations confirm.
#pragma once

#include <optional>
#include <vector>

#include "friction/stick_slip.hpp"
#include "run/events/event_candidates.hpp"

namespace pn {

struct Crossing {
    Watch watch;
    double part, slope;  // part of the step, and rate of the margin at this part per step
    bool leaps = false;  // the margin jumps below zero without a root
};

class EventSearch {
public:
    // `pulls`: true for each contact in tension at the step's start.
    EventSearch(System& system, Stepper& stepper, const std::vector<char>& pulls, GapWatch& watch);

    // Return the first crossing. The workspace must be evaluated at the step's end. If there is no crossing, the
    // workspace is evaluated at the step's end again.
    std::optional<Crossing> first();
    // Return the deepest penetrating gap at the end of a repeated step, except the gap `touches`. This gap
    // closed before, because the motion differs slightly from the interpolant.
    std::optional<Crossing> deepest_penetration(const Watch& touches);

    // Return a margin, positive before the event and zero at it. The workspace must be evaluated at the state.
    double margin(const Watch& watch, double t, const VecX& y);

private:
    // Evaluation of a margin inside the step: interpolated velocities, interpolated force / limit ratios, kinematics,
    // or a whole evaluation.
    enum class Source { velocities, shares, kinematics, evaluation };

    bool slows_down(int element, double rest) const;
    Source source(const Watch& watch) const;
    bool integrates() const;
    double interpolated_share(int element, double part) const;
    double share_error(int element) const;
    double margin_inside(const Watch& watch, Source source, double part);
    double first_crossing(const Watch& watch, Source source);
    Crossing cross(const Watch& watch, Source source);
    std::optional<Crossing> behind_leap(const Watch& watch, Source source, double part);
    Crossing confirmed(const Crossing& told);
    std::optional<double> confirm(const Watch& watch, double part, double slope, double at_start);

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    GapSearch gaps_;
    EventCandidates candidates_;
    double share_error_ = 0.0;  // error of the sampled force / limit ratio
    VecX probe_, probe_rate_;
};

}  // namespace pn
