// Forces of one motion, as the residuals of its laws read them (dynamics/law_residuals.hpp).
#pragma once

#include <vector>

#include "forces/friction.hpp"

namespace pn {

struct MotionForces {
    VecX given;      // F, and forces of the laws without modes, per dof
    VecX magnitude;  // sum of the magnitudes of their terms
    VecX lam;        // multipliers per kept row, zero for rows that are not in use
    std::vector<Vec3> friction;  // per element, along its directions
    // The same forces with the shares among redundant rows that solutions report.
    VecX shared_lam;
    std::vector<Vec3> shared_friction;
    // Per element: false if an element sticks whose share of the load no motion determines.
    std::vector<char> is_determined;
    std::vector<SlipLimits> limits;  // per element: limits at rest under its load, before the static ratio
};

}  // namespace pn
