// Contacts that touch at a state, among them those at rest and those that strike.
#pragma once

#include <vector>

#include "contact/onset.hpp"

namespace pn {

struct TouchingContactsParameters {
    // Time [s] within which a closing gap touches.
    double touching_time = 1e-12;
    // At the start of a run, gaps up to this fraction of the scene's size touch.
    double starting_width = 1e-10;
    // No body closes a wider gap [m or rad] within `touching_time`: its speed would exceed the speed of light.
    double sure_gap = 1e-3;
};

inline constexpr TouchingContactsParameters touching_contacts_parameters{};

// Contact state: touching contacts, resting contacts, and impacts.
struct TouchingContacts {
    std::vector<char> touch, rest;
    bool strikes = false;
    bool lands = false;  // some impact is at an open contact
};
// Find touching contacts from the widths and rates of the gaps at (t, q, v): closed gaps and narrow gaps. Of several
// coincident gaps, only the gap that opens last counts, else a closed gap.
TouchingContacts touching_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts);

// Caches the touching contacts of the last state.
class TouchingCache {
public:
    const TouchingContacts& at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts);

private:
    bool is_set_ = false, starts_ = false;
    double t_ = 0.0;
    VecX q_, v_;
    std::vector<char> closed_;
    TouchingContacts found_;
};

}  // namespace pn
