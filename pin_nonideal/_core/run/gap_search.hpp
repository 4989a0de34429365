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

// Widths and rates of all gaps at one instant, and how the round bodies among them face each other.
struct GapState {
    std::vector<double> width, rate;
    std::vector<Separation> separation;

    explicit GapState(size_t gaps = 0) : width(gaps, 0.0), rate(gaps, 0.0), separation(gaps) {}
};

class GapSearch {
public:
    GapSearch(System& system, Stepper& stepper, const GapState& at_start);

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
    bool stays_open(const Look& a, const Look& b, double bound) const;
    std::optional<Touch> search(int gap, const Look& a, const Look& b, const Bends& bends);
    Touch between(int gap, const Look& a, const Look& b);
    void bound_rates();
    Bends bends(int gap) const;

    System& system_;
    Stepper& stepper_;
    const Program& p;
    Workspace& w;
    const GapState& start_;
    Reach reach_;
    std::vector<Look> end_;
    std::vector<Bends> bends_;
    VecX speed_, acceleration_, probe_;
    double rounding_ = 0.0;
    int looks_ = 0;
};

// Widths and rates of all gaps at the state that the workspace is evaluated at.
void look_at_gaps(System& system, double t, GapState& out);

}  // namespace pn
