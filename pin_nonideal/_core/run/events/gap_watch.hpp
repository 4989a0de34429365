// Gaps from step to step: how wide they are, and which of them are far, so that steps need not look at them.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "contact/bounds/distance.hpp"
#include "contact/bounds/travel.hpp"
#include "run/integrators/system.hpp"

namespace pn {

// A gap at one instant, and how the round bodies of it face each other.
struct GapLook {
    double part, width, rate;
    std::optional<Separation> separation;

    // Of the gap that the workspace is evaluated for.
    static GapLook here(const Program& p, const Workspace& w, int gap, double part);
};

// Gaps at a step's start, as they were looked at last. One that is wide beside what its bodies can come in a step is far:
// it is not looked at, step after step, until their ways since then add up to its width.
struct GapState {
    std::vector<double> width, rate;
    std::vector<Separation> separation;
    static constexpr char from_the_end = 2;  // near, and not looked at before the end of the step at hand
    std::vector<char> near, far;           // looked at in each step, or far; neither where closed, or nothing moves
    std::vector<double> way, turn, apart;  // of far ones: their bodies' ways when they were looked at (contact/ways.hpp)
    Ways ways;
    double ask = 0.0;            // the scene's way at which far ones are asked again
    bool current = false;        // of the state now, or of the step that led to it
    std::vector<int> near_gaps;  // in order
    // Of one that others hold on its plane, and that did not close when it was asked to: since when that is so, and until
    // when it is not asked again.
    std::vector<double> vain_since, rests_until;

    // `round`: whether any of so many gaps is that of round bodies.
    explicit GapState(size_t gaps = 0, bool round = false)
        : width(gaps, 0.0), rate(gaps, 0.0), separation(round ? gaps : 0), near(gaps, 0), far(gaps, 0), way(gaps, 0.0),
          turn(gaps, 0.0), apart(gaps, 0.0), vain_since(gaps, 0.0), rests_until(gaps, -HUGE_VAL) {}
    void keep(int gap, const GapLook& look);
    void find_near();
    void ask_in_vain(int gap, double t);
    // Contacts have changed: all are asked again.
    void ask_anew() { std::fill(rests_until.begin(), rests_until.end(), -HUGE_VAL); }
};

class GapWatch {
public:
    GapWatch(System& system, GapState& gaps);

    // At the state that the system has read and the workspace is evaluated at. Of all gaps, as a run begins or after
    // anything but a step; or after a step that was followed to its end, of those that are near.
    void look_at_all(double t);
    void go_on(double t);

    // Over a step just taken, of length h with the largest |v| of each dof. Far gaps that the ways of their bodies may have
    // closed by its end are near from here on: those returned were not looked at in the steps before.
    const std::vector<int>& follow(const VecX& speed, double h);

    // Time stepping looks once a step, at its middle: of the gaps that are near there those are far from then on that are
    // wide. `way`: how far each dof has come since the last look, or since the state at which these steps began.
    const std::vector<int>& come(const VecX& way);
    void leave_far();
    // There all are near but those that are known to be far, and wider than `least`.
    void begin_time_steps(double least);

    GapState& gaps;
    const WayBound ways;
    // Each of the near ones at the end of the step at hand, where that was followed.
    std::vector<GapLook> end;
    bool followed = false;

private:
    void look(double t, int gap);  // here
    // Far or near, by its width as just looked at.
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
