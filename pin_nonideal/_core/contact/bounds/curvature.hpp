// How fast gaps may change their rate over a step: a bound on the second derivative of each, from bounds on the rates of
// the joints and on their accelerations. With it no touch is leapt over, however long the step.
#pragma once

#include <cmath>

#include "dynamics/workspace.hpp"

namespace pn {

class Reach {
public:
    explicit Reach(const Program& p);

    // Largest |v| and |a| of each dof over a step of length h; the bodies in the workspace stand at one end of it.
    void bound_bodies(const Workspace& w, const VecX& speed, const VecX& acceleration, double h);
    // Over that step the second derivative of a gap stays above -bound, or between round bodies that of the gap of any two
    // of their points does (contact/separation.hpp).
    double bound(const Workspace& w, int gap) const;
    // Of the user's gaps nothing is known.
    static bool knows(const Program& p, int gap);
    // And below this while the gap is open.
    double rise(const Workspace& w, int gap) const;
    // By how much the gap may change over the step at most; infinite where that is not known.
    double travel(int gap) const { return h_ * speed(gap); }
    // Of its points against each other, at the most.
    double speed(int gap) const;

private:
    struct Bound {  // on a body's origin and on its turning
        double velocity = 0.0, acceleration = 0.0, spin = 0.0, spin_rate = 0.0;
    };
    Bound joint_bound(const Joint& joint) const;
    Bound frame_bound(const Frame& frame) const;
    double of(const Workspace& w, const ContactRow& kind) const;
    double of(const Workspace& w, const EllipsoidRow& kind) const;
    double of(const Workspace& w, const CapsulesRow& kind) const;
    double of(const Workspace& w, const BoxRow& kind) const;
    double of(const Workspace& w, const LineRow& kind) const;
    double of(const Workspace& w, const RimRow& kind) const;
    double of(const Workspace& w, const RimsRow& kind) const;
    template <class Solid> double of(const Workspace& w, const SolidRow<Solid>& kind) const;
    double of(const Workspace& w, const LimitRow& kind) const;
    double of_points(const Frame& frame1, double reach1, const Frame& frame2, double reach2) const;
    double over_plane(const Workspace& w, const Frame& frame, const Frame& plane, double reach) const;
    double speed(const ContactRow& kind) const;
    double speed(const EllipsoidRow& kind) const;
    double speed(const CapsulesRow& kind) const;
    double speed(const BoxRow& kind) const;
    double speed(const LineRow& kind) const;
    double speed(const RimRow& kind) const;
    double speed(const RimsRow& kind) const;
    template <class Solid> double speed(const SolidRow<Solid>& kind) const;
    double speed(const LimitRow& kind) const { return speed_[p.mechanism.joints[kind.joint].iv]; }
    template <class K> double speed(const K&) const { return HUGE_VAL; }
    double rise(double reach1, double reach2, const Frame& frame1, const Frame& frame2, double radius) const;

    const Program& p;
    std::vector<int> joints_;  // that gaps hang on, each after its parent
    std::vector<Bound> bodies_;
    VecX speed_, acceleration_;
    double h_ = 0.0;
};

}  // namespace pn
