// Gaps from step to step: their widths, and the wide gaps that steps skip.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

#include "contact/bounds/distance.hpp"
#include "contact/bounds/travel.hpp"
#include "run/integrators/system.hpp"

namespace pn {

// Sample of a gap at one instant, with the separation of its round bodies.
struct GapSample {
    double part, width, rate;
    std::optional<Separation> separation;

    // Return the sample of a gap for which the workspace is evaluated.
    static GapSample here(const Program& p, const Workspace& w, int gap, double part);
};

// Gaps at a step's start, as sampled last. Steps skip a gap that is wide relative to the travel of its bodies in a step,
// until the travel since the last sample adds up to the width. Other open gaps are monitored.
struct GapState {
    std::vector<double> width, rate;
    std::map<int, Separation> separation;     // of gaps that were monitored
    static constexpr char from_step_end = 2;  // monitored, but first sampled at the end of the current step
    std::vector<char> monitored, skipped;     // sampled in each step, or not (neither: closed or immovable)
    // Travel of the bodies of skipped gaps at the last sample (contact/bounds/travel.hpp).
    std::vector<double> path_length, turn, distance;
    TravelState travel;
    // Travel of the scene at which skipped gaps are rechecked: of each group of gaps, and the least one.
    std::vector<double> group_recheck;
    double recheck_travel = 0.0;
    bool current = false;             // the samples belong to the current state, or to the step that led to it
    std::vector<int> monitored_gaps;  // indices of monitored gaps, ascending
    // For a touching gap that the solver left open: time of the first attempt, and time before which it is not retried.
    std::vector<double> blocked_since, retry_time;

    // `groups`: number of groups of gaps.
    explicit GapState(size_t gaps = 0, size_t groups = 0)
        : width(gaps, 0.0), rate(gaps, 0.0), monitored(gaps, 0), skipped(gaps, 0),
          path_length(gaps, 0.0), turn(gaps, 0.0), distance(gaps, 0.0), group_recheck(groups, 0.0),
          blocked_since(gaps, 0.0), retry_time(gaps, -HUGE_VAL) {}
    void keep(int gap, const GapSample& sample);
    Separation separation_of(int gap) const;  // at the last sample
    void list_monitored();
    // Recheck a group at this travel of the scene, or before.
    void recheck_at(int group, double scene_travel) {
        group_recheck[group] = std::min(group_recheck[group], scene_travel);
        recheck_travel = std::min(recheck_travel, scene_travel);
    }
    // Set the travel at which all groups are rechecked.
    void recheck_all_at(double scene_travel) {
        std::fill(group_recheck.begin(), group_recheck.end(), scene_travel);
        recheck_travel = scene_travel;
    }
    void defer_retry(int gap, double t);
    bool is_blocked(int gap) const { return retry_time[gap] > -HUGE_VAL; }
    // Retry all blocked gaps, after a change of contacts.
    void retry_all() { std::fill(retry_time.begin(), retry_time.end(), -HUGE_VAL); }
};

struct GapWatchParameters {
    // Minimum width of a skipped gap, in travels of one step. Narrower gaps would be rechecked at once.
    double min_skipped_steps = 2.0;
    // Factors on the travel since a skipped gap's last sample, and on the travel in one step. The gap is monitored again
    // if their sum can close it.
    double recheck_factor = 2.0, steps_ahead = 2.0;
    // Rounding error of a difference of travels, relative to the travel so far.
    double travel_rounding = 1e-15;
    // Minimum time [s] before a blocked gap is retried. Later it is retried after as long as it has been blocked.
    double min_retry_delay = 1e-4;
};

class GapWatch {
public:
    using Parameters = GapWatchParameters;
    static constexpr Parameters parameters{};

    GapWatch(System& system, GapState& gaps);

    // Sample gaps at the state that the system has read and the workspace is evaluated at. `sample_all` samples all
    // gaps, at the start of a run or after a change other than a step. `sample_monitored` samples the monitored gaps
    // after a step that was followed to its end.
    void sample_all(double t);
    void sample_monitored(double t);

    // Follow a step just taken, of length h with the largest |v| of each dof. Skipped gaps that the travel of their
    // bodies may close by the step's end are monitored from then on. Return the gaps to sample at the step's start.
    const std::vector<int>& follow(const VecX& speed, double h);

    // Return the monitored gaps. Time stepping samples them once per step, at its middle. `path_length`: travel of each dof
    // since the last sample, or since the state at which these steps began. Wide gaps leave the monitored set by
    // `skip_wide`.
    const std::vector<int>& advance(const VecX& path_length);
    void skip_wide();
    // Check if a monitored gap was wider at its sample than its bodies can close by the end of this step of time stepping.
    bool stays_open_in_step(int gap) const;
    // Return the gaps that stay open while the dofs travel `path_length` from the state of the last call of `advance`, per
    // gap. The width of these gaps is positive there, although it is not measured.
    const std::vector<char>& open_after(const VecX& path_length);
    // Begin time stepping: all gaps are monitored, except skipped gaps wider than `least`.
    void begin_time_steps(double least);

    GapState& gaps;
    const TravelBound travel;
    // samples of the monitored gaps at the end of the current step, if it was followed
    std::vector<GapSample> end;
    bool followed = false;

private:
    void sample(double t, int gap);  // at the current state
    // Classify a gap as skipped or monitored by its last width.
    void classify(int gap);
    void step(const VecX& speed, double h);
    void recheck_skipped();
    bool recheck_group(int group);
    void undo_step();

    System& system_;
    const Program& p;
    Workspace& w;
    std::vector<int> unsampled_;
    // Groups of gaps between the same two bodies that follow each other: group of each gap, and first gap of each group,
    // then the number of gaps.
    std::vector<int> group_, first_of_group_;
    TravelState ahead_;
    std::vector<char> open_;
};

}  // namespace pn
