// The unknowns y of the implicit reaction equation y = g(y): the limits of slipping frictions and the forces of users'
// laws. Given y the motion follows from the factors at hand, the motion gives the loads, and these an image g(y).
#pragma once

#include "dynamics/law_forces.hpp"
#include "dynamics/friction_limit.hpp"

namespace pn {

struct Unknowns {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    int n = 0;
    bool bearings = true;  // no function of the user's is among them: a ReactionEquation says all

    Unknowns(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

    // Calls the first for each slipping element, then the second for each law, in the order of the unknowns.
    template <class OnElement, class OnLaw>
    void each(const OnElement& on_element, const OnLaw& on_law) const {
        for (int e : w.now.slipping)
            if (p.frictions[e].reaction == Reaction::total) on_element(static_cast<size_t>(e));
        if (p.user_laws == 0) return;
        each_law<UserLaw>(p.laws, [&](const UserLaw& law) { if (law.reaction == Reaction::total) on_law(law); });
    }
    std::vector<int> elements() const;

    void set(const VecX& y);
    // The motion for the limits and user forces in the workspace.
    void motion();
    void image(const VecX& y, VecX& g);
    // g as arrays, by the motion for each unknown in turn. Steps are as large as the unknowns: g hides only lengths.
    // Where contacts share a load, it is that of the piece that is held.
    void equation(const VecX& y, ReactionEquation& found);
    // What rounding of loads that are shared leaves of the image: a contact that carries hardly anything has its load from
    // the same sums as those beside it that carry all.
    double rounding() const;
    // Whether a solution of that is one of y = g(y): no contact that may open pulls, and where some share a load it lies
    // in the piece that was held.
    bool is_motion(const VecX& y);
};

}  // namespace pn
