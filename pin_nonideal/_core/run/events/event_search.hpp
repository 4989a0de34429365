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
    double part, slope;  // fraction of the step at the crossing, and rate of the margin there per step
    bool jumps = false;  // the margin jumps below zero without a root
};

struct EventSearchParameters {
    int grid = 24;                // number of intervals of a step for the first samples of a margin
    double spacing = 1.0 / grid;  // length of a grid interval, relative to the step
    // A parabola through three points falls below the middle one by at most 1/8 of its second difference. Dips up to
    // twice that depth are searched.
    double parabola_part = 0.25;
    // `jump_part`: negative margin that counts as a jump, relative to the margin at the step's start. `jump_digits`:
    // relative time difference that separates two instants.
    double jump_part = 1e-3, jump_digits = 1e-15;
    // Error of a force / limit ratio that comes from an interpolant of low order, relative to its change.
    double doubted_part = 1e-2;
    int max_confirmations = 3;  // maximum evaluations that confirm an interpolated crossing
    // Tolerance of the correction of a crossing, relative to the step. The remaining error is the square of the
    // correction, which the repeated step corrects.
    double confirmed_width = 1e-4;
    // A margin jumps if more than this fraction of it is left at the interpolated crossing. The polynomial through
    // rates before and after a jump is very steep, so slope corrections are tiny wherever the jump lies.
    double left_part = 0.1;
};

class EventSearch {
public:
    using Parameters = EventSearchParameters;
    static constexpr Parameters parameters{};

    // `pulls`: true for each contact in tension at the step's start.
    EventSearch(System& system, Stepper& stepper, const std::vector<char>& pulls, GapWatch& watch);

    // Return the first crossing, without the slip of the elements `arrived`. The workspace must be evaluated at the
    // step's end. If there is no crossing, the workspace is evaluated at the step's end again.
    std::optional<Crossing> first(const std::vector<int>& arrived);
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
    std::optional<Crossing> cross_jump(const Watch& watch, Source source, double part);
    Crossing confirmed(const Crossing& interpolated);
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
