// Query of the stick-slip modes at one state: which friction elements are at rest, and the modes of the others.
#pragma once

#include <vector>

#include "dynamics/workspace.hpp"

namespace pn {

struct ModeQuery {
    std::vector<Mode> modes;  // per element, ignored for elements at rest
    std::vector<int> at_rest;
    // Elements at rest that just reached their limit: they slip at the limit even with zero acceleration.
    std::vector<int> at_limit;
    bool several = false;            // a motion with other modes than `modes` is known
    int several_element = -1;        // element whose friction differs in that motion, or -1 if this is not known
    bool is_solved_jointly = false;  // `modes` belong to a motion solved with all contacts
    // Modes, slip directions and friction of all elements in a nearby motion, if known.
    std::vector<Mode> nearby_modes = {};
    std::vector<Vec3> nearby_directions = {}, nearby_friction = {};
};

// Set up the query from the slip velocities of the rows last evaluated. Elements at rest are sticking elements, elements
// that came to rest, and `also`. Moving elements slip along their velocities.
ModeQuery make_mode_query(const Program& p, Workspace& w, const VecX& v, int also = -1);
// Set up the query at a start, where no mode is known, from the velocity of every element. Updates the kinematics.
ModeQuery make_first_mode_query(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Set the mode of a moving element from its slip velocity in the rows last evaluated.
void follow_velocity(const Program& p, Workspace& w, int element, ModeQuery& query);
// Set the slip directions of moving elements from their slip velocities in the rows last evaluated, except for elements at
// rest.
void follow_slip(const Program& p, Workspace& w, const VecX& v, const std::vector<int>& at_rest = {});
// After a projection, update the kinematics and set the slip directions of moving elements again. Does nothing unless steps
// solve for slip directions, since other methods read slip velocities.
void follow_projection(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                       const std::vector<int>& at_rest);

// Check if an element sticks or has zero slip speed at (q, v), up to rounding. Rows must be evaluated.
bool at_rest(const Program& p, const Workspace& w, int element, const VecX& v);

}  // namespace pn
