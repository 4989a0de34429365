#include "run/inside_samples.hpp"

#include "dynamics/projection.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

static void hold(const Program& p, Workspace& w, const InsideStates& inside, size_t k) {
    if (k == 0 || !(inside.modes[k] == inside.modes[k - 1])) set_modes(p, w, inside.modes[k]);
    for (size_t e = 0; e < p.frictions.size(); ++e)
        w.state.slip_direction[e] = w.state.last_direction[e] = inside.directions[k].segment<3>(3 * e);
    w.state.warm = false;
    w.now.has_override = !inside.torque.empty() && inside.torque[k].allFinite();
    if (w.now.has_override) w.now.override_torque = inside.torque[k];
}

void sample_inside(const Program& p, Workspace& w, const InsideStates& inside, const RecordOptions& options,
                   Recording& out) {
    System system(p, w, options.energy);
    Recorder recorder(system, options, out);
    VecX y = VecX::Zero(system.ny);
    for (size_t k = 0; k < inside.t.size(); ++k) {
        y.head(system.ns) = inside.y[k];
        system.normalize(y);
        hold(p, w, inside, k);
        system.read(y);
        system.read_law_states(y);
        begin_step(p, w, inside.t[k], system.q, system.v);
        project(p, w, inside.t[k], system.q, system.v);
        system.write(y);
        recorder.sample(inside.t[k], y, {0.0, inside.moved[k]}, false);
    }
}

}  // namespace pn
