// Where in a step just taken an open gap first closes. Widths and rates at two instants and the bound on the second
// derivative between them (contact/reach.hpp) show that it stays open in between, or the stretch is halved, on the
// method's own interpolant: nothing is leapt over.
#pragma once

#include <algorithm>

#include "contact/bounds/curvature.hpp"
#include "run/events/gap_watch.hpp"
#include "run/integrators/stepper.hpp"

namespace pn {

class GapSearch {
public:
    GapSearch(System& system, Stepper& stepper, GapWatch& watch);

    // Gaps that may close in the step; the workspace must be evaluated at its end, and stays so.
    struct Bends { double below, above; };  // least (less than zero) and largest second derivative
    struct Doubt {
        int gap;
        GapLook end;  // of the step
        Bends bends;  // over it
    };
    const std::vector<Doubt>& doubtful();
    const std::vector<Doubt>& doubted() const { return doubtful_; }  // as found last
    // Part of the step at which one of them closes, and its rate there over the step. Leaves the workspace elsewhere.
    struct Touch { double part, slope; };
    std::optional<Touch> first_touch(int gap);  // of them
    // What the gap counts from in this step: rounding may leave it below its plane, from where it rises.
    double plane(int gap) const { return start_.rate[gap] > 0.0 ? std::min(0.0, start_.width[gap]) : 0.0; }

private:
    using Look = GapLook;
    Look look(int gap, double part);
    Look look_at_start(int gap) const;
    // Above what the gap counts from: its plane, or between round bodies the lowest place that they touch at.
    Look above(Look look, double level) const;
    double level_here(int gap, double part) const;
    bool stays_open(int gap, const Look& a, const Look& b, double bound) const;
    std::optional<Touch> search(int gap, const Look& a, const Look& b, const Bends& bends);
    Touch between(int gap, const Look& a, const Look& b);
    void bound_rates();
    bool same_bodies(int gap, int other) const;
    bool has_held_copy(int gap) const;
    bool slides_on(int gap) const;  // the same two bodies touch elsewhere
    void look_at_starts(const std::vector<int>& gaps);
    Bends bends(int gap, const Look& end) const;

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    GapWatch& watch_;
    GapState& start_;
    Reach reach_;
    std::vector<Doubt> doubtful_;
    std::vector<int> held_;  // closed ones of round bodies: a place that the same two bodies come to next is no lower
    VecX speed_, acceleration_, probe_;
    double rounding_ = 0.0;
    int looks_ = 0;
};

}  // namespace pn
