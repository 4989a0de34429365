// Where in a step just taken an open gap first closes. Widths and rates at two instants and the bound on the second
// derivative between them (contact/reach.hpp) show that it stays open in between, or the stretch is halved, on the
// method's own interpolant: nothing is leapt over.
#pragma once

#include <algorithm>
#include <optional>

#include "contact/reach.hpp"
#include "contact/separation.hpp"
#include "run/stepper.hpp"

namespace pn {

// Widths and rates of all gaps at one instant, and how the round bodies among them face each other. A gap that is wide
// beside what its bodies can travel is not looked at, step after step, as long as it is sure to be open.
struct GapState {
    std::vector<double> width, rate;
    std::vector<Separation> separation;
    std::vector<double> sure;    // width that is left of the one looked at last, whatever moved since
    std::vector<double> travel;  // over the step at hand, of gaps that are not looked at; else zero
    std::vector<char> stale;     // whether width, rate and separation are of an earlier instant

    explicit GapState(size_t gaps = 0)
        : width(gaps, 0.0), rate(gaps, 0.0), separation(gaps), sure(gaps, 0.0), travel(gaps, 0.0), stale(gaps, 0) {}
    // Of the gap that the workspace is evaluated for.
    void look(const Program& p, const Workspace& w, int gap);
};

class GapSearch {
public:
    GapSearch(System& system, Stepper& stepper, GapState& at_start);

    // Gaps that may close in the step; the workspace must be evaluated at its end, and stays so.
    std::vector<int> doubtful();
    // Part of the step at which one of them closes, and its rate there over the step. Leaves the workspace elsewhere.
    struct Touch { double part, slope; };
    std::optional<Touch> first_touch(int gap);
    // What the gap counts from in this step: rounding may leave it below its plane, from where it rises.
    double plane(int gap) const { return start_.rate[gap] > 0.0 ? std::min(0.0, start_.width[gap]) : 0.0; }

private:
    struct Look {
        double part, width, rate;
        std::optional<Separation> separation;  // of round bodies
    };
    struct Bends { double below, above; };  // least (less than zero) and largest second derivative
    Look look(int gap, double part);
    Look look_here(int gap, double part) const;
    Look look_at_start(int gap) const;
    bool stays_open(int gap, const Look& a, const Look& b, double bound) const;
    std::optional<Touch> search(int gap, const Look& a, const Look& b, const Bends& bends);
    Touch between(int gap, const Look& a, const Look& b);
    void bound_rates();
    bool stays_far(int gap);
    bool same_bodies(int gap, int other) const;
    bool slides_on(int gap) const;  // the same two bodies touch elsewhere
    void look_at_starts(const std::vector<int>& gaps);
    Bends bends(int gap) const;

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    GapState& start_;
    Reach reach_;
    std::vector<Look> end_;
    std::vector<Bends> bends_;
    std::vector<int> near_, unseen_;
    std::vector<int> held_;  // closed ones of round bodies: a place that the same two bodies come to next is no lower
    VecX speed_, acceleration_, probe_;
    double rounding_ = 0.0;
    int looks_ = 0;
};

// Widths and rates of the gaps at the state that the workspace is evaluated at, but for those that stayed far in the step
// before.
void look_at_gaps(System& system, double t, GapState& out);

}  // namespace pn
