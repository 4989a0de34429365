// Search for the first closing of an open gap in a step just taken. Widths, rates and a bound on the second derivative
// (contact/bounds/curvature.hpp) can prove that the gap stays open between two instants. Otherwise the stretch is
// halved on the method's own interpolant, so no closing is missed.
#pragma once

#include <algorithm>

#include "contact/bounds/curvature.hpp"
#include "run/events/gap_watch.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

struct GapSearchParameters {
    // Rounding error of a closed gap [m], relative to the scene's size.
    double width_rounding = 1e-14;
    // Bound of the accelerations between the stages of an accepted step, relative to the largest one at the stages.
    double between_stages = 2.0;
    // Maximum number of samples of a gap that stays near its plane. After that it counts as closed.
    int max_samples = 4000;
    // Fractions of a step at which a gap that may stay on its plane is sampled.
    double plane_parts[5] = {0.11, 0.29, 0.5, 0.73, 0.93};
    // Safety factor on the travel of bodies, for the moves of projections.
    double travel_factor = 2.0;
    double rate_rounding = 1e-12;  // change of a constant rate by rounding, relative to the rates
};

class GapSearch {
public:
    using Parameters = GapSearchParameters;
    static constexpr Parameters parameters{};

    GapSearch(System& system, Stepper& stepper, GapWatch& watch);

    // Candidates: gaps that may close in the step. The workspace must be evaluated at the step's end, and stays so.
    struct Bends { double below, above; };  // bounds of the second derivative: magnitude below zero, and largest value
    struct Candidate {
        int gap;
        GapSample end;  // sample at the step's end
        Bends bends;  // bounds over the step
    };
    const std::vector<Candidate>& find_candidates();
    const std::vector<Candidate>& candidates() const { return candidates_; }  // candidates of the last search
    // Fraction of the step at which a candidate closes, and rate of its gap at this instant per step. The search leaves the
    // workspace at another state.
    struct Touch { double part, slope; };
    std::optional<Touch> first_touch(int gap);  // `gap`: a candidate
    // Return the zero level of the gap in this step. Rounding can leave a rising gap below its plane at the start.
    double plane(int gap) const { return start_.rate[gap] > 0.0 ? std::min(0.0, start_.width[gap]) : 0.0; }

private:
    GapSample sample(int gap, double part);
    GapSample sample_at_start(int gap) const;
    // Measure a sample from a zero level: the plane, or for round bodies the lowest contact point of the same two
    // bodies.
    GapSample above(GapSample sample, double level) const;
    double level_here(int gap, double part) const;
    bool stays_open(int gap, const GapSample& a, const GapSample& b, double bound) const;
    bool stays_on_plane(int gap, const GapSample& a, const GapSample& b);
    std::optional<Touch> search(int gap, const GapSample& a, const GapSample& b, const Bends& bends);
    Touch between(int gap, const GapSample& a, const GapSample& b);
    void bound_rates();
    bool has_closed_copy(int gap) const;
    bool slides_on(int gap) const;  // the same two bodies touch at another point
    void sample_starts(const std::vector<int>& gaps);
    Bends bends(int gap, const GapSample& end) const;

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    GapWatch& watch_;
    GapState& start_;
    CurvatureBounds curvature_;
    std::vector<Candidate> candidates_;
    std::vector<int> closed_round_;  // closed gaps of round bodies, their next contact point is not lower
    VecX speed_, acceleration_, probe_;
    double rounding_ = 0.0;
    int samples_ = 0;
};

}  // namespace pn
