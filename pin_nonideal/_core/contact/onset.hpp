// Onset of motion of contacts at rest, for all contacts together, by the cone problem of resting_problem.hpp. If all
// contacts rest and no constraint joins the trees, the faster solver of rest_of_trees.hpp may show that rest lasts.
#pragma once

#include <optional>

#include "contact/resting_problem.hpp"

namespace pn {

// Solve for the motion of the contacts at rest at (t, q, v). Return nothing if other laws depend on loads too, or if no
// motion was found. The modes in the workspace are restored.
std::optional<OnsetMotion> onset_motion(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                        const OnsetQuery& query);

// Check if a bound proves that the contacts at rest have one motion at (t, q, v), whatever opens, sticks and slips. Without
// several rough contacts the search of the modes proves it. For many contacts that rest at once the bound is not computed.
bool is_choice_unique(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const OnsetQuery& query);

// Return true if forces within the cones of all closed contacts hold them at (t, q, v). Return false if one of these
// contacts slides, or if other laws depend on loads too.
bool closed_contacts_hold(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
