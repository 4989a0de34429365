// What contacts that rest on each other begin to do, all at once. With the forces f of their normals and of friction as
// unknowns, the accelerations of gaps and slips are w = w0 + W f, and the laws of Signorini and Coulomb between them are
// a cone problem (friction/cone_problem.hpp): which contacts lift, which slip and where to, however many share a load.
#pragma once

#include <optional>

#include "friction/slip_onset.hpp"

namespace pn {

struct RestingMotion {
    std::vector<char> closed;     // of all gaps
    std::vector<Mode> modes;      // of all elements
    std::vector<Vec3> direction;  // of the slip of those that begin to slip
    std::vector<Vec3> friction;   // of each element, along its directions
    bool shared = false;          // contacts share their load in several ways
    bool is_near = false;         // not the motion that is asked for, but one from which to look for it

    bool slides() const;  // some slip already, or begin to
    // The modes of elements at rest, with the directions in which they begin to slip; of a near one its friction.
    void answer(const Program& p, Workspace& w, ModeQuestion& question) const;
};

struct ClosingQuestion {
    std::vector<char> rest;     // contacts that rest on each other
    int opening = -1;           // of them the one whose load has just come down to zero
    int arrived = -1;           // the element that has just come to rest or to its limit
    std::vector<int> breaking;  // elements that stuck until now and have just come to their limit: they slip
    bool struck = false;        // what stuck may move: its velocity tells
};
// Of the contacts that rest at (t, q, v). Nothing where other laws depend on loads too, or no motion was found. The modes
// in the workspace stay.
std::optional<RestingMotion> resting_motion(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                            const ClosingQuestion& question);

// Returns true if forces within the cones of all closed contacts hold them at (t, q, v). Returns false if one of them
// slides, or if other laws depend on loads too.
bool closed_contacts_hold(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
