#include "run/integrators/semi_implicit_euler.hpp"

#include "dynamics/projection.hpp"
#include "tree/lie_group.hpp"

namespace pn {

void SemiImplicitEuler::advance(System& system) {
    step_.y1 = step_.y0 + step_.h * step_.start_rate();
    system.v = step_.h * system.velocity(step_.y1);
    follow_constraints(system.p, system.w, step_.h, system.v);
    retract(system.p.mechanism, step_.y0.data(), system.v.data(), step_.y1.data());
}

void SemiImplicitEuler::learn(System& system) const { learn_third_order(system.p, system.w, step_.h); }

void SemiImplicitEuler::interpolate(double part, VecX& y) const {
    y = step_.y0 + part * delta_;
}

}  // namespace pn
