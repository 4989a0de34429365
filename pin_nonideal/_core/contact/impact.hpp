// Impacts: velocities jump when gaps close. With impulses P of all touching contacts, their velocities after the impact
// are u+ = u- + W P. W is the Delassus matrix under loops and prescribed motions.
//
// Newton's law of restitution: 0 <= P_n, u_n+ + e u_n- >= 0 complementary, and P_t in Coulomb's cone against u_t+.
// Poisson's law: the first phase stops the approach (e = 0, impulses C). In the second phase every contact exerts e C_n, or
// more to prevent penetration, with friction in the corresponding cone.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct ImpactParameters {
    // Rounding error of responses relative to the largest response to an impulse, and of velocities relative to the speed.
    double min_response = 1e-12, velocity_rounding = 1e-14;
};

inline constexpr ImpactParameters impact_parameters{};

struct Impact {
    std::vector<int> gaps;        // touching gaps
    std::vector<Vec3> impulse;    // impulse of each gap: along the normal, then along the slip directions
    std::vector<double> work;     // work of each gap
    VecX v_minus, v_plus;
    double energy_change = 0.0;   // change of the total kinetic energy, including work of moving constraints
};

// Gap rates below this value are rest [m/s or rad/s].
double rest_rate(const VecX& v);

// Compute the impact of contacts `touching` (per gap) at (t, q, v). v becomes the velocity after it. Joint friction has a
// finite limit and gives no impulse. The contacts are closed afterwards, without modes of friction. Without `bounces`
// restitution is ignored, for rebounds that cannot be distinguished from rest.
Impact resolve_impact(const Program& p, Workspace& w, double t, const VecX& q, VecX& v, const std::vector<char>& touching,
              bool bounces = true);

}  // namespace pn
