// Search for the first zero crossing of a margin in a step just taken. There are four kinds of margins:
// - slip speed of a slipping element,
// - distance of a sticking element to its limit,
// - normal force of a contact,
// - gap of an open contact.
//
// Speeds, forces and limits at the stages show which margins may have crossed. The method's own interpolant locates the
// crossing. Slip uses interpolated velocities, which need no evaluation. Sticking uses the rate of the integrated force
// / limit ratio, which one or two evaluations confirm.
#pragma once

#include <optional>
#include <vector>

#include "friction/stick_slip.hpp"
#include "run/events/gap_search.hpp"

namespace pn {

// Slip that may remain if sticking rows are almost redundant, relative to 1 + the largest speed of the scene [rad/s or
// m/s]. Such rows amplify rounding.
constexpr double raised_rest_speed = 1e-9;

// Margin that may cross zero inside the step.
struct Watch {
    enum class Kind { slip, stick, contact, load, gap } kind;
    int index;  // index of the friction element, the bilateral contact or the gap
};

struct Crossing {
    Watch watch;
    double part, slope;  // part of the step, and rate of the margin there per step
    bool leaps = false;  // the margin jumps below zero without a root
};

class EventSearch {
public:
    // `pulls`: true for each contact in tension at the step's start.
    EventSearch(System& system, Stepper& stepper, const std::vector<char>& pulls, GapWatch& watch);

    // Return the first crossing. The workspace must be evaluated at the step's end. If there is no crossing it is
    // evaluated there again.
    std::optional<Crossing> first();
    // Return the deepest penetrating gap at the end of a repeated step, other than the gap that touches there. This gap
    // closed before, because the motion differs slightly from the interpolant.
    std::optional<Crossing> entered(const Watch& touches);

    // Return a margin, positive before the event and zero at it. The workspace must be evaluated at the state.
    double margin(const Watch& watch, double t, const VecX& y);

private:
    // Evaluation of a margin inside the step: interpolated velocities, interpolated force / limit ratios, kinematics,
    // or a whole evaluation.
    enum class Source { velocities, shares, kinematics, evaluation };

    double noise() const;
    double allowance(int element) const;
    bool may_reach_limit(int element);
    bool may_stop(int element) const;
    bool dips(int element) const;
    bool slows_down(int element, double rest) const;
    void add_pulls(std::vector<Watch>& list);
    std::vector<Watch> crossed();
    bool may_pull(int gap);

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
    const std::vector<char>& pulls_;
    GapSearch gaps_;
    double doubt_ = 0.0;        // error of the sampled force / limit ratio
    VecX probe_, probe_rate_;
};

}  // namespace pn
