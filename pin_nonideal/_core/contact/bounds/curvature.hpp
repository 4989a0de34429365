// Bounds on the second derivative of gaps over a step, from bounds on joint velocities and accelerations. The bounds
// guarantee that steps of any length detect every contact.
#pragma once

#include <cmath>

#include "dynamics/workspace.hpp"

namespace pn {

class CurvatureBounds {
public:
    explicit CurvatureBounds(const Program& p);

    // Set the largest |v| and |a| of each dof over a step of length h. The bodies in the workspace are at one end of
    // the step.
    void bound_bodies(const Workspace& w, const VecX& speed, const VecX& acceleration, double h);
    // Over that step the second derivative of a gap is at least -bound. For round bodies this holds for the distance of
    // any two material points (contact/bounds/distance.hpp).
    double lower_bound(const Workspace& w, int gap) const;
    // Check if bounds exist. User gaps have none.
    static bool has_bounds(const Program& p, int gap);
    // Upper bound of the second derivative of a gap while the gap is open.
    double upper_bound(const Workspace& w, int gap) const;
    // Maximum change of a gap over the step. Infinite if unknown.
    double max_change(int gap) const { return h_ * speed(gap); }
    // Maximum relative speed of a contact's points. Infinite if unknown.
    double speed(int gap) const;

private:
    struct Bound {  // bounds of a body's origin and rotation
        double velocity = 0.0, acceleration = 0.0, spin = 0.0, spin_rate = 0.0;
    };
    Bound joint_bound(const Joint& joint) const;
    Bound frame_bound(const Frame& frame) const;
    double of_points(const Frame& frame1, double extent1, const Frame& frame2, double extent2) const;
    double over_plane(const Workspace& w, const Frame& frame, const Frame& plane, double extent) const;

    const Program& p;
    std::vector<int> joints_;  // joints that move contacts, each after its parent
    std::vector<Bound> bodies_;
    VecX speed_, acceleration_;
    double h_ = 0.0;
};

}  // namespace pn
