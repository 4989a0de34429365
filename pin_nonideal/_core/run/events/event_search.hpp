// Where in a step just taken a margin first crosses zero: of the slip speed of what slips, of what is left to the limit of
// what sticks, of the normal force of a contact, of the gap of an open one.
//
// Speeds, forces and limits at the stages tell what may have crossed. The method's own interpolant tells where: of slip
// by its velocities, which take no evaluation, of what sticks by the rate of the shares that it integrates, which one or
// two evaluations confirm.
#pragma once

#include <optional>
#include <vector>

#include "friction/stick_slip.hpp"
#include "run/events/gap_search.hpp"

namespace pn {

// What may cross zero inside the step.
struct Watch {
    enum class Kind { slip, stick, contact, load, gap } kind;
    int index;  // of the friction element, or of the contact: of one that is kept, or of a gap
};

struct Crossing {
    Watch watch;
    double part, slope;  // of the step, and the rate of the margin there over the step
    bool leaps = false;  // the margin is no root: it falls below zero at once
};

class EventSearch {
public:
    // Whether each contact pulls by the step's start.
    EventSearch(System& system, Stepper& stepper, const std::vector<char>& pulls, GapWatch& watch);

    // The first crossing; the workspace must be evaluated at the step's end, and is so again where there is none.
    std::optional<Crossing> first();
    // The step has been taken again up to an event: a gap that its end is beyond, but one that touches there; the deepest.
    // It is closed before that, where the motion is not quite that of the interpolant.
    std::optional<Crossing> entered(const Watch& touches);

    // Positive before the event, zero at it. The workspace must be evaluated at the state.
    double margin(const Watch& watch, double t, const VecX& y);

private:
    // How a margin is found inside the step: from the interpolated velocities or shares alone, by kinematics, or by a
    // whole evaluation.
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
    double doubt_ = 0.0;        // of the share that is looked at
    VecX probe_, probe_rate_;
};

}  // namespace pn
