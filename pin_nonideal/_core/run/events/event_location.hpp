// Location of an event inside a step.
//
// An event passes through four files: event_candidates.hpp lists the values that may cross zero in the step,
// event_search.hpp finds the first crossing on the interpolant, this file locates its instant, and mode_selection.hpp
// selects the modes there.
//
// The search on the interpolant gives a first guess of the instant. The step is then repeated up to that instant, so an
// event is as accurate as a step. The remaining margin corrects the step's end. A step can miss the rest of slip in
// several directions by more than the tolerance. Such a step ends before the rest, and a shorter step follows.
#pragma once

#include <optional>
#include <vector>

#include "run/events/event_search.hpp"
#include "run/events/release_location.hpp"

namespace pn {

struct EventLocationParameters {
    // Speed below which slip in several directions has come to rest in fixed steps, relative to 1 + the largest
    // velocity. Fixed steps do not locate the instant of rest.
    double arrived_speed = 1e-7;
    // Slip passes by rest if it keeps more than `rest_part` of its speed at the step's start and exceeds
    // `passing_speed`.
    double rest_part = 0.05, passing_speed = 1e-6;
    // Slip acceleration of an element that prescribed motions have stopped, relative to the largest acceleration. At the
    // instant of the stop it may still decelerate: the next step is `part_after_stop` of the step and shows the rest.
    double stopped_acceleration = 1e-9, part_after_stop = 1e-4;
    // Length of a fixed step toward a rest: relative to the time to the rest, and minimum relative to the full step.
    double part_toward_rest = 0.5, min_shortened_part = 1e-3;
    // A step that misses a rest ends before it, by `part_before_rest` of the time to the rest. If slip begins with
    // fewer than `negligible_slip` tolerances, the step may end at the rest.
    double part_before_rest = 0.1, negligible_slip = 10.0;
    // --- Repeated step
    int max_correction_passes = 12;  // maximum Newton steps and secants for the instant
    // Maximum number of earlier gaps that replace a crossing. The repeated step differs slightly from its interpolant,
    // so gaps that close almost together can change their order.
    int max_closed_before = 4;
    // Corrections of the instant that end its location: relative to the time, and relative to the step.
    double time_rounding = 2e-16, end_tolerance = 1e-13;
    // Maximum move of the step's end along the rate there and its mean change, relative to the step. Longer moves repeat the
    // step. A move neglects a quarter of its square times the second difference of the rate in the step. A flight can be
    // a millionth of the tried step, and a move over all of it would neglect the fall.
    double moved_part = 1e-5;
    // Passes that reduce the margin by less than this ratio, `max_stalls` in a row, find its rounding if the instant moves
    // by less than `settled_part` of the step. Newton's method and secants reduce other margins faster.
    double margin_ratio = 0.25, settled_part = 1e-5;
    int max_stalls = 2;  // one such pass occurs near a kink of the margin
};

class EventLocator {
public:
    using Parameters = EventLocationParameters;
    static constexpr Parameters parameters{};

    // `slip_at_start`: slip speed at the step's start of each element with several directions. `pulls`: true for each
    // contact in tension at that time.
    EventLocator(System& system, Stepper& stepper, ErrorNorm& norm, const std::vector<double>& slip_at_start,
                 const std::vector<char>& pulls, GapWatch& watch);

    // End the step just taken at its first event. The workspace is evaluated at the step's end in either case.
    std::optional<FoundEvent> locate();
    // Return the time from the step's end to the rest of slip before which the step was ended, if any.
    std::optional<double> time_to_rest() const { return time_to_rest_; }

    // Return the length of the next step if prescribed motions may have stopped an element at the step's end.
    std::optional<double> step_after_stop() const;
    // Shorten a fixed step toward the rest of slip in several directions, whose direction can turn fast at the end. The
    // workspace must be evaluated at the step's start.
    double shorten_toward_rest(const VecX& rate, double size);

private:
    bool has_arrived(int element) const;
    // Prescribed motions may stop elements, which methods of SciPy do not release again.
    bool follows_drives(int element) const { return p.follows_drives(element) && !stepper_.method.outside(); }
    bool is_rest(double slip) const;
    bool is_stopped(int element) const;
    bool passes_by_rest(int element) const;
    bool misses_rest(const Watch& watch) const;

    double margin_at_end(const Watch& watch);
    void correct_end_to(double size);
    void step_onto(const Crossing& crossing);
    void correct_instant(const Crossing& crossing, double full);
    void end_before_rest();

    System& system_;
    Stepper& stepper_;
    ErrorNorm& norm_;
    const Program& p;
    Workspace& w;
    const std::vector<double>& slip_at_start_;
    EventSearch search_;
    ReleaseLocator releases_;
    std::optional<double> time_to_rest_;
};

}  // namespace pn
