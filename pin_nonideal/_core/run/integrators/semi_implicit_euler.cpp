#include "run/integrators/semi_implicit_euler.hpp"

#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"
#include "tree/lie_group.hpp"

namespace pn {

void SemiImplicitEuler::advance(System& system) {
    step_.y1 = step_.y0 + step_.h * step_.start_rate();
    if (drives_.any()) take_drives_implicitly(system);
    system.v = step_.h * system.velocity(step_.y1);
    follow_constraints(system.p, system.w, step_.h, system.v);
    retract(system.p.mechanism, step_.y0.data(), system.v.data(), step_.y1.data());
}

void SemiImplicitEuler::return_to_start(System& system) {
    system.read(step_.y0);
    system.read_law_states(step_.y0);
    begin_step(system.p, system.w, step_.t0, system.q, system.v);
}

// Replace the velocity and the states of the laws at the step's end by those under implicit drives.
void SemiImplicitEuler::take_drives_implicitly(System& system) {
    Workspace& w = system.w;
    system.read(step_.y0);
    system.read_law_states(step_.y0);
    JointDrives::Step drives(drives_, system.p, w, step_.t0, step_.h, system.q, system.v,
                             JointDrives::Deflection::end);
    configure(system.p, w, step_.t0, system.q, system.v);
    drives.move(system.v, system.v);
    assemble_forces(system.p, w, step_.t0, system.v);
    solve_dynamics(system.p, w, step_.t0, system.v);
    step_.y1.segment(system.nq, system.nv) = system.v + step_.h * w.now.a;
    const auto of_laws = Eigen::seqN(system.nq + system.nv, system.nz);
    step_.y1(of_laws) = step_.y0(of_laws) + step_.h * w.now.dz;
    drives.end_deflections(system.velocity(step_.y1), step_.y1.segment(system.nq + system.nv, system.nz));
}

void SemiImplicitEuler::learn(System& system) const { learn_third_order(system.p, system.w, step_.h); }

void SemiImplicitEuler::interpolate(double part, VecX& y) const {
    y = step_.y0 + part * delta_;
}

}  // namespace pn
