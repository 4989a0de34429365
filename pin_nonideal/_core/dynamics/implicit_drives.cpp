#include "dynamics/implicit_drives.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

double implicit_part(double h, double inertia, double stiffness, double damping) {
    constexpr double slow = 1e-3;  // decay within a step below which the series is exact
    const double half = 0.5 * damping / inertia, square = half * half - stiffness / inertia;
    const double decay = h * (half + (square > 0.0 ? std::sqrt(square) : 0.0));
    const double turns = square < 0.0 ? h * std::sqrt(-square) : 0.0;
    // Exponential fit: one step multiplies the fastest motion by exp(-decay).
    const double decay_part = decay < slow ? 0.5 + decay / 12.0 : 1.0 / -std::expm1(-decay) - 1.0 / decay;
    const double vibration_part = turns > 1.0 ? 1.0 - 0.5 / turns : 0.5;
    return std::max(decay_part, vibration_part);
}

void ImplicitDrives::add_inertia(const Mechanism& m, Terms& terms) {
    for (int dof = 0; dof < m.nv; ++dof) {
        theta[dof] = 0.5;
        inertia[dof] = 0.0;
        if (stiffness[dof] == 0.0 && damping[dof] == 0.0) continue;
        double& diagonal = terms.M[m.row_offset[dof]];
        theta[dof] = implicit_part(h, diagonal, stiffness[dof], damping[dof]);
        const double step = theta[dof] * h;
        inertia[dof] = step * (damping[dof] + step * stiffness[dof]);
        diagonal += inertia[dof];
    }
}

void ImplicitDrives::set_velocity(const VecX& v0, const VecX& v) {
    for (int dof = 0; dof < force.size(); ++dof)
        force[dof] = damping[dof] * (v[dof] - v0[dof]) - (2.0 * theta[dof] - 1.0) * h * stiffness[dof] * v0[dof];
}

}  // namespace pn
