// Onset of motion of contacts at rest, for all contacts together. With normal and friction forces f as unknowns, the
// accelerations of gaps and slips are w = w0 + W f. The laws of Signorini and Coulomb give a cone problem
// (complementarity/cone/problem.hpp). Its solution shows the lifting contacts and the slip directions, even for shared
// loads.
#pragma once

#include <optional>

#include "friction/slip_onset.hpp"

namespace pn {

struct RestingMotion {
    std::vector<char> closed;     // by gap
    std::vector<char> loaded;     // closed contacts that press, by gap
    std::vector<Mode> modes;      // by element
    std::vector<Vec3> direction;  // slip direction at onset, by element
    std::vector<Vec3> friction;   // friction of each element, along its directions
    bool several = false;         // rest is admissible, and a motion from rest as well
    bool shared = false;          // contacts are hyperstatic
    bool is_near = false;         // only an initial guess for the search of the motion

    bool slides() const;  // some contact slips or begins to slip
    // Set the modes of elements at rest and their slip directions at onset. An initial guess sets its friction only.
    void answer(const Program& p, Workspace& w, ModeQuestion& question) const;
};

struct ClosingQuestion {
    std::vector<char> rest;     // contacts at rest on each other
    int opening = -1;           // contact of `rest` whose load just reached zero
    int arrived = -1;           // element that just came to rest or reached its limit
    std::vector<int> breaking;  // elements that stuck and just reached their limit: they slip
    bool prescribed = false;    // the caller sets the modes
    bool struck = false;        // after an impact the velocity decides if a sticking element slips
};
// Solve for the motion of the contacts at rest at (t, q, v). Return nothing if other laws depend on loads too, or if no
// motion was found. The modes in the workspace are restored.
std::optional<RestingMotion> resting_motion(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                            const ClosingQuestion& question);

// Returns true if forces within the cones of all closed contacts hold them at (t, q, v). Returns false if one of them
// slides, or if other laws depend on loads too.
bool closed_contacts_hold(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);

}  // namespace pn
