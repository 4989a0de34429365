// Unknowns y of the implicit reaction equation y = g(y): limits of slipping elements and forces of user laws. The current
// factors give the motion for y. The motion gives the loads, and the loads give an image g(y).
#pragma once

#include "dynamics/law_forces.hpp"
#include "dynamics/friction_limit.hpp"

namespace pn {

struct UnknownsParameters {
    // Rounding error of a solution at the boundary of two zero-load sets, relative to the unknowns.
    double zero_load_set_rounding = 1e-11;
    // Rounding error of shared loads, relative to the largest multiplier.
    double shared_rounding = 1e-13;
    // Maximum number of steps of Newton's method for y = g(y).
    int max_newton = 30;
};

struct Unknowns {
    using Parameters = UnknownsParameters;
    static constexpr Parameters parameters{};

    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    int n = 0;
    bool bearings = true;  // no user function among the unknowns: a ReactionEquation is exact

    Unknowns(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

    // Call the first function for each slipping element, then the second for each law, in the order of the unknowns.
    template <class OnElement, class OnLaw>
    void each(const OnElement& on_element, const OnLaw& on_law) const {
        for (int e : w.now.slipping)
            if (p.frictions[e].reaction == Reaction::total) on_element(static_cast<size_t>(e));
        if (p.user_laws == 0) return;
        each_law<UserLaw>(p.laws, [&](const UserLaw& law) { if (law.reaction == Reaction::total) on_law(law); });
    }
    std::vector<int> elements() const;

    void set(const VecX& y);
    // Compute the motion for the limits and user forces in the workspace.
    void motion();
    void image(const VecX& y, VecX& g);
    // Assemble g as arrays from one motion for each unknown. Steps are as large as the unknowns, since g is nonlinear
    // only by vector lengths. If contacts share a load, the frozen zero-load set applies.
    void equation(const VecX& y, ReactionEquation& found);
    // Rounding error of the image due to shared loads. A nearly unloaded contact has its load from the same sums as loaded
    // contacts.
    double rounding() const;
    // Check if a solution of the arrays solves y = g(y). Then no unilateral contact has tension, and shared loads are
    // consistent with the frozen zero-load set.
    bool is_motion(const VecX& y);
};

}  // namespace pn
