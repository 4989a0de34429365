// Gaps from step to step: their widths, and the far gaps that steps need not sample.
#pragma once

#include <algorithm>
#include <cmath>
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

// Gaps at a step's start, as sampled last. A gap is far if it is wide relative to the travel of its bodies in a step.
// Steps skip far gaps until the travel since the last sample adds up to the width.
struct GapState {
    std::vector<double> width, rate;
    std::vector<Separation> separation;
    static constexpr char from_the_end = 2;  // near, but first sampled at the end of the current step
    std::vector<char> near, far;           // near: sampled in each step, far: skipped, neither: closed or immovable
    // Travel of the bodies of far gaps at the last sample (contact/bounds/travel.hpp).
    std::vector<double> way, turn, apart;
    TravelState travel;
    double ask = 0.0;            // travel of the scene at which far gaps are rechecked
    bool current = false;        // the samples belong to the current state, or to the step that led to it
    std::vector<int> near_gaps;  // indices of near gaps, ascending
    // For a touching gap that the solver left open: time of the first attempt, and time before which it is not retried.
    std::vector<double> blocked_since, retry_time;

    // `round`: true if a gap is between round bodies.
    explicit GapState(size_t gaps = 0, bool round = false)
        : width(gaps, 0.0), rate(gaps, 0.0), separation(round ? gaps : 0), near(gaps, 0), far(gaps, 0), way(gaps, 0.0),
          turn(gaps, 0.0), apart(gaps, 0.0), blocked_since(gaps, 0.0), retry_time(gaps, -HUGE_VAL) {}
    void keep(int gap, const GapSample& look);
    void find_near();
    void defer_retry(int gap, double t);
    bool is_in_vain(int gap) const { return retry_time[gap] > -HUGE_VAL; }
    // Retry all blocked gaps, after a change of contacts.
    void ask_anew() { std::fill(retry_time.begin(), retry_time.end(), -HUGE_VAL); }
};

struct GapWatchParameters {
    // Minimum width of a far gap, in travels of one step. Narrower gaps would be rechecked at once.
    double steps_of_far = 2.0;
    // Factors on the travel since a far gap's last sample, and on the travel in one step. The gap is monitored again if
    // their sum can close it.
    double asked_again = 2.0, steps_ahead = 2.0;
    // Rounding of a difference of travels, relative to the travel so far.
    double way_rounding = 1e-15;
    // Minimum time [s] before a blocked gap is retried. Later it is retried after as long as it has been blocked.
    double least_rest = 1e-4;
};

class GapWatch {
public:
    using Parameters = GapWatchParameters;
    static constexpr Parameters parameters{};

    GapWatch(System& system, GapState& gaps);

    // Sample gaps at the state that the system has read and the workspace is evaluated at. `sample_all` samples all
    // gaps, at the start of a run or after a change other than a step. `sample_near_gaps` samples the near gaps after a step
    // that was followed to its end.
    void sample_all(double t);
    void sample_near_gaps(double t);

    // Follow a step just taken, of length h with the largest |v| of each dof. Far gaps that the travel of their bodies
    // may close by the step's end become near. Return the new near gaps that must be sampled at the step's start.
    const std::vector<int>& follow(const VecX& speed, double h);

    // Return the near gaps for the sample of time stepping, taken once per step at its middle. `way`: travel of each
    // dof since the last sample, or since the state at which these steps began. `leave_far` then makes wide gaps far.
    const std::vector<int>& come(const VecX& way);
    void leave_far();
    // Check if a near gap was wider at its sample than its bodies can close by the end of this step of time stepping.
    bool stays_open_in_step(int gap) const;
    // Begin time stepping: all gaps become near, except far gaps wider than `least`.
    void begin_time_steps(double least);

    GapState& gaps;
    const TravelBound travel;
    // samples of the near gaps at the end of the current step, if it was followed
    std::vector<GapSample> end;
    bool followed = false;

private:
    void look(double t, int gap);  // at the current state
    // Classify a gap as far or near by its last width.
    void place(int gap);
    void step(const VecX& speed, double h);
    void ask_far();
    void take_back();

    System& system_;
    const Program& p;
    Workspace& w;
    std::vector<int> unseen_;
};

}  // namespace pn
