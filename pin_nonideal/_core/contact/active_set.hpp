// Which contacts that touch stay closed: their loads press, and what opens moves apart. All that rest on each other are
// closed unless their loads cannot press; where several choices would do, the one with the most of them closed.
#pragma once

#include <functional>

#include "contact/onset.hpp"

namespace pn {

// Gaps narrower than this [m or rad], or closed within this time [s], touch.
constexpr double touching_width = 1e-12, touching_time = 1e-12;
// At the start of a run gaps up to this part of the scene's size touch.
constexpr double starting_width = 1e-10;

// What contacts do at a state: they touch and rest on each other, or strike, or are apart.
struct Touching {
    std::vector<char> touch, rest;
    bool strikes = false;
    bool lands = false;  // one of those that strike is open as yet
};
// By the widths and rates of the gaps at (t, q, v): those that are closed, or so narrow, touch; of those that coincide one
// does for all.
Touching touching_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts);

// As found last: asked again where nothing has changed, it needs no look at the gaps.
class TouchingKnown {
public:
    const Touching& at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts);

private:
    bool known_ = false, starts_ = false;
    double t_ = 0.0;
    VecX q_, v_;
    std::vector<char> closed_;
    Touching found_;
};

// Whether all that begins to slip from rest goes against its friction. Where a contact would have to pull the others may
// rub in ways that are none of theirs, and hide it.
bool goes_its_way(const Program& p, Workspace& w, const VecX& v);

// Closes contacts out of those that rest at (t, q, v). `find_modes` finds what sticks and slips for those closed, or takes
// it from the motion of all of them together where there is one, and leaves the workspace with the motion at v. Where no
// other is found it is one in which some of what begins to slip does not go its way yet, as steps make it do.
void close_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                    const ClosingQuestion& question, const std::function<void(const RestingMotion*)>& find_modes);

}  // namespace pn
