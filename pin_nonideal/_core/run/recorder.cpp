#include "run/recorder.hpp"

#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"

namespace pn {

static void append(std::vector<double>& to, const VecX& x) { to.insert(to.end(), x.data(), x.data() + x.size()); }

void Recorder::reserve(size_t samples) {
    const std::pair<std::vector<double>*, int> widths[] = {
        {&out.t, 1}, {&out.q, system.nq}, {&out.v, system.nv}, {&out.violation, 1}, {&out.violation_rate, 1}};
    for (const auto& [values, width] : widths) values->reserve(samples * width);
}

void Recorder::sample(double t, const VecX& y, double moved_energy, bool evaluated) {
    system.read(y);
    if (!evaluated && options.evaluates()) {
        system.read_law_states(y);
        evaluate(p, w, t, system.q, system.v);
    } else if (!evaluated && p.constraints > 0) {
        update_kinematics(p, w, t, system.q, system.v);
    }
    double position, velocity;
    violations(p, w, position, velocity);
    out.t.push_back(t);
    append(out.q, system.q);
    append(out.v, system.v);
    out.violation.push_back(position);
    out.violation_rate.push_back(velocity);
    if (system.nz > 0) append(out.z, y.segment(system.nq + system.nv, system.nz));
    for (size_t e = 0; e < p.frictions.size(); ++e) out.modes.push_back(w.state.mode[e]);
    if (options.a) append(out.a, w.now.a);
    if (options.power) {
        power_.setZero(power_count(p));
        powers(p, w, system.v, power_.data());
        append(out.power, power_);
    }
    if (options.energy) {
        out.energy.push_back(kinetic_energy(p.mechanism, w.now.terms, system.v));
        out.energy.push_back(potential_energy(p.mechanism, w.now.terms));
        append(out.energy, y.segment(system.nq + system.nv + system.nz, system.nw));
        out.energy.push_back(moved_energy);
    }
    if (options.forces) {
        split_forces(p, w, split_);
        append(out.F_ideal, split_.F_ideal);
        append(out.F_nonideal, split_.F_nonideal);
        append(out.lam, split_.lam);
        append(out.lam_ideal, split_.lam_ideal);
    }
}

}  // namespace pn
