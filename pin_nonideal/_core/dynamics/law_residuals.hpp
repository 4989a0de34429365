// Residuals of the laws that every motion satisfies: equation of motion, Signorini's conditions, limits of friction, and
// maximum dissipation. The residuals follow from the state, the acceleration and the forces. No residual reads a mode of
// friction.
//
// All residuals are relative to one scale, the largest force of the scene. Forces and accelerations of different units
// compare as roots of energies: dof i divides its force by sqrt(M_ii), and a row multiplies its force and divides its
// acceleration by its length, max_i |A_i| / sqrt(M_ii).
#pragma once

#include <utility>

#include "dynamics/failure.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

struct LawResidualParameters {
    // Largest residual of a motion that satisfies the laws.
    double tolerance = 1e-10;
    // Smallest scale of the forces, in their units: powers of smaller forces underflow.
    double min_force = 1e-140;
    // Slip acceleration of elements that begin to slip exactly at their limits. The direction of this acceleration is not
    // defined.
    double onset_acceleration = 1e-6;
    // Largest residual of friction while rows are so close to a singular position that their orthogonal factorization is
    // in use. Such rows amplify the rounding error of loads.
    double singular_tolerance = 1e-8;
};

inline constexpr LawResidualParameters law_residual_parameters{};

// Largest residual of one law, and the dof, block or friction element that has it.
struct LargestResidual {
    double size = 0.0;
    int index = -1;

    void include(double residual, int of) {
        if (!(residual <= size)) *this = {residual, of};
    }
};

enum class MotionLaw { motion, signorini, coulomb, dissipation };

struct LawResiduals {
    LargestResidual motion;       // M a + nle = tau + C + A^T lam, per dof
    LargestResidual signorini;    // min(N, gap acceleration) = 0 of touching contacts with gap rate zero, per block
    LargestResidual coulomb;      // |f| <= limit, per friction element
    LargestResidual dissipation;  // f opposite to the slip velocity, or to the slip acceleration at rest, per element
    double friction_tolerance = law_residual_parameters.tolerance;  // tolerance of the last two residuals

    // Return the law with the largest residual, relative to its tolerance.
    std::pair<MotionLaw, LargestResidual> largest() const;
    bool are_small() const;
    // Failure of a motion at time t whose residuals are not small.
    Failure failure(double t) const;
};

// Properties of the state of a motion.
struct MotionState {
    std::vector<int> open;    // open contacts that touch with gap rate zero
    double slip_error = 0.0;  // error of slip velocities [m/s, rad/s]
    // The motion ends at this state. Slip that has just come to rest has the friction of the motion before the rest.
    bool is_end = false;
};

// Collect the forces of the motion in the workspace. Limits that depend on reactions follow from the loads of the same
// motion.
const MotionForces& motion_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v);
// Return the largest residuals of the acceleration and forces of a motion, for the terms and rows in the workspace.
// The rows of open contacts are evaluated here.
LawResiduals law_residuals(const Program& p, Workspace& w, double t, const VecX& v, const VecX& a,
                           const MotionForces& forces, const MotionState& state);

// Return the residuals of the motion in the workspace. If the residuals are small, the counters of the workspace keep the
// largest residuals. Scenes without friction and contacts have no residuals.
LawResiduals check_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const MotionState& state);

}  // namespace pn
