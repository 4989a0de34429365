// Margins that may have crossed zero in a step just taken. There are five kinds of margins:
// - slip speed of a slipping element,
// - distance of a sticking element to its limit,
// - normal force of a bilateral contact,
// - load of a closed unilateral contact,
// - gap of an open contact.
//
// Speeds, forces and limits at the stages select the candidates, and bounds on the motion select the gaps.
#pragma once

#include <vector>

#include "run/events/gap_search.hpp"

namespace pn {

// Margin that may cross zero inside the step.
struct Watch {
    enum class Kind { slip, stick, contact, load, gap } kind;
    int index;  // index of the friction element, the bilateral contact or the gap
};

struct EventCandidatesParameters {
    // Rounding tolerance of the force / limit ratio at the stages.
    double share_rounding = 1e-9;
    // Safety margins of the force / limit ratio between the stages. The first is a factor on the rise of a parabola
    // above three stages, the second a fraction of the ratio's range.
    double times_parabola = 3.0, range_between = 0.02;
    // Allowed reverse speed of an element that has just begun to slip, relative to the speed of rest.
    double fresh_slip = 1e-3;
    // A minimum speed between two stages counts as a dip below zero if it is below this fraction of the speeds' range.
    // The error of the cubics through the stages is smaller.
    double dip_part = 0.02;
    // Rounding error of the margin of a sticking element under a constant force, relative to the friction limit.
    double limit_rounding = 1e-12;
    // Slip that may remain if sticking rows are almost redundant, relative to 1 + the largest speed of the scene [rad/s
    // or m/s]. Such rows amplify rounding errors.
    double raised_rest_speed = 1e-9;
};

class EventCandidates {
public:
    using Parameters = EventCandidatesParameters;
    static constexpr Parameters parameters{};

    // `pulls`: true for each contact in tension at the step's start.
    EventCandidates(System& system, Stepper& stepper, const std::vector<char>& pulls, GapSearch& gaps)
        : system_(system), stepper_(stepper), p(system.p), w(system.w), pulls_(pulls), gaps_(gaps) {}

    // Return the margins that are negative at the step's end, or may have crossed zero inside the step. Slip of the
    // elements `arrived` ends at the step's end. The workspace must be evaluated at the step's end.
    std::vector<Watch> find(const std::vector<int>& arrived);
    // Return the speed with which an element of deferred sticking may slip against its mode.
    double allowance(int element) const;

private:
    double noise() const;
    bool may_reach_limit(int element);
    bool may_stop(int element) const;
    bool dips(int element) const;
    void add_pulls(std::vector<Watch>& list);
    bool may_pull(int gap);

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    const std::vector<char>& pulls_;
    GapSearch& gaps_;
};

}  // namespace pn
