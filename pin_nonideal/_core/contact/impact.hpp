// Impacts: velocities jump where gaps close. With percussions P of all contacts that touch, their velocities after are
// u+ = u- + W P, W the Delassus matrix through loops and prescribed motions: 0 <= P_n, u_n+ + e u_n- >= 0 complementary
// (Newton's law of restitution), P_t in Coulomb's cone against u_t+. By Poisson's the approach is stopped first (the same
// with e = 0, impulses C), and then every contact gives e C_n again, or more where it would be entered, with friction in
// the cone of that.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct Impact {
    std::vector<int> gaps;        // that touch
    std::vector<Vec3> impulse;    // of each, along the normal, then along the directions of slip
    std::vector<double> work;     // of each
    VecX v_minus, v_plus;
    double energy_change = 0.0;   // of the whole, works of moving constraints included
};

// Impulses below this part of the largest of an impact are rounding.
constexpr double impulse_rounding = 1e-14;

// Rates of gaps slower than this are rest [m/s or rad/s].
double rest_rate(const VecX& v);

// The impact of contacts `touching` (by gap) at (t, q, v), v becomes the velocity after it. Friction of joints has a
// finite limit and gives no impulse. The contacts are left closed, their modes open. Without restitution, where what they
// would give back is not to be told from rest.
Impact strike(const Program& p, Workspace& w, double t, const VecX& q, VecX& v, const std::vector<char>& touching,
              bool bounces = true);

}  // namespace pn
