#include "run/recorder.hpp"

#include "dynamics/evaluation.hpp"

namespace pn {

static void append(std::vector<double>& to, const VecX& x) { to.insert(to.end(), x.data(), x.data() + x.size()); }

void Recorder::reserve(size_t samples) {
    const std::pair<std::vector<double>*, int> widths[] = {
        {&out.t, 1}, {&out.q, system.nq}, {&out.v, system.nv}, {&out.violation, 1}, {&out.violation_rate, 1}};
    for (const auto& [values, width] : widths) values->reserve(samples * width);
}

void Recorder::sample(double t, const VecX& y, bool evaluated) {
    q_ = y.head(system.nq);
    v_ = y.segment(system.nq, system.nv);
    if (!evaluated && options.evaluates()) {
        if (system.nz > 0) w.state.z = y.segment(system.nq + system.nv, system.nz);
        evaluate(p, w, t, q_, v_);
    } else if (!evaluated && p.constraints > 0) {
        update_kinematics(p, w, t, q_, v_);
    }
    double position, velocity;
    violations(p, w, position, velocity);
    out.t.push_back(t);
    append(out.q, q_);
    append(out.v, v_);
    out.violation.push_back(position);
    out.violation_rate.push_back(velocity);
    if (system.nz > 0) append(out.z, y.segment(system.nq + system.nv, system.nz));
    for (size_t e = 0; e < p.frictions.size(); ++e) out.modes.push_back(w.state.mode[e]);
    if (options.a) append(out.a, w.now.a);
    if (options.power) {
        power_.resize(3 + p.law_names.size());
        power_.setZero();
        powers(p, w, v_, power_.data());
        append(out.power, power_);
    }
    if (options.energy) {
        out.energy.push_back(kinetic_energy(p.mechanism, w.now.terms, v_));
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
