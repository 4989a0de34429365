// Contacts of a pair of convex shapes that would push against each other in a time step.
//
// All contacts of two convex shapes push apart in about one direction. An edge that meets a shape from inside pushes in the
// opposite direction, like a corner at the far side of a shape of equal width.
#pragma once

#include <vector>

#include "dynamics/workspace.hpp"

namespace pn {

struct OpposedContactsParameters {
    double opposed = -0.7;  // largest cosine between opposite normals of two contacts of one pair
    double alike = 0.4;     // smallest cosine to one normal that excludes opposite normals
};

class OpposedContacts {
public:
    using Parameters = OpposedContactsParameters;
    static constexpr Parameters parameters{};

    explicit OpposedContacts(const Program& p);

    // If contacts of one pair oppose each other, keep one direction in the ascending list `touching`. A face has priority,
    // then a contact that was closed before, then the fastest approach. The contacts must be evaluated.
    void drop(const Program& p, const Workspace& w, const std::vector<char>& was_closed, std::vector<int>& touching);

private:
    std::vector<char> between_lines_;  // true for each gap between edges or rims
    std::vector<int> all_, of_pair_;
};

}  // namespace pn
