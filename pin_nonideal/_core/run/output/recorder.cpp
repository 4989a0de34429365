#include "run/output/recorder.hpp"

#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/reported_loads.hpp"

namespace pn {

void append_closed(const Program& p, const Workspace& w, std::vector<std::int8_t>& to) {
    for (int block : p.all_contacts) to.push_back(block < p.first_gap || w.state.closed[block - p.first_gap]);
}

static void append(std::vector<double>& to, const VecX& x) { to.insert(to.end(), x.data(), x.data() + x.size()); }

void Recorder::reserve(size_t samples) {
    const std::pair<std::vector<double>*, int> widths[] = {
        {&out.t, 1}, {&out.q, system.nq}, {&out.v, system.nv}, {&out.violation, 1}, {&out.violation_rate, 1}};
    for (const auto& [values, width] : widths) values->reserve(samples * width);
}

std::vector<int> reaction_blocks(const Program& p) {
    std::vector<int> blocks;
    for (int i = 0; i < p.constraints; ++i)
        if (frames(p.blocks[i].kind).first) blocks.push_back(i);
    return blocks;
}

std::vector<int> framed_contacts(const Program& p) {
    std::vector<int> blocks;
    for (int block : p.all_contacts)
        if (frames(p.blocks[block].kind).first) blocks.push_back(block);
    return blocks;
}

void Recorder::record_contacts() {
    for (int block : framed_contacts(p)) {
        const Vec3 force = carried_wrench(p, w, block).lin;
        for (int k = 0; k < 3; ++k) out.contact_forces.push_back(force[k]);
    }
}

void Recorder::record_laws(double t) {
    LawForceList& force = w.scratch.law_force;
    law_forces(p, w, system.v, force);
    for (int law = 0; law < static_cast<int>(supports_.size()); ++law)
        for (int dof : supports_[law]) out.law_forces.push_back(force.of(law)[dof]);
    for (size_t e = 0; e < p.frictions.size(); ++e)
        out.limits.push_back(current_limit(p, w, static_cast<int>(e), t, system.q, system.v));
}

void Recorder::record_reactions() {
    const auto record = [&](const Force& f, const Mat3& axes) {
        for (const Vec3& part : {transpose_times(axes, f.lin), transpose_times(axes, f.ang), f.lin, f.ang})
            for (int k = 0; k < 3; ++k) out.reactions.push_back(part[k]);
    };
    const std::vector<Body>& body = w.now.terms.body;
    for (size_t joint = 1; joint < p.mechanism.joints.size(); ++joint)
        record(joint_wrench(p, w, static_cast<int>(joint)), body[joint].R);
    for (int block : reaction_blocks(p)) {
        const Frame& frame = *frames(p.blocks[block].kind).second;
        record(carried_wrench(p, w, block), body[frame.joint].R * frame.R);
    }
}

void Recorder::sample(double t, const VecX& y, const Jumps& jumps, bool evaluated,
                      const std::vector<char>* open_gaps) {
    system.read(y);
    if (!evaluated && options.evaluates()) {
        system.read_law_states(y);
        evaluate(p, w, t, system.q, system.v);
    } else if (!evaluated && (p.constraints > 0 || !w.now.closed_gaps.empty())) {
        update_kinematics(p, w, t, system.q, system.v);
    }
    double position, velocity;
    violations(p, w, t, system.v, position, velocity, open_gaps);
    out.t.push_back(t);
    append(out.q, system.q);
    append(out.v, system.v);
    out.violation.push_back(position);
    out.violation_rate.push_back(velocity);
    if (system.nz > 0) append(out.z, y.segment(system.nq + system.nv, system.nz));
    out.modes.insert(out.modes.end(), w.state.mode.begin(), w.state.mode.end());
    append_closed(p, w, out.closed);
    if (options.a) append(out.a, w.now.a);
    if (options.tau) append(out.tau, w.now.tau);
    if (options.power) {
        power_.setZero(power_count(p));
        powers(p, w, system.v, power_.data());
        append(out.power, power_);
    }
    std::optional<ReportedLoads> loads;
    if (options.laws || options.reactions || options.forces) loads.emplace(p, w);
    if (options.laws) record_laws(t);
    if (options.reactions) record_reactions();
    if (options.energy) {
        out.energy.push_back(kinetic_energy(p.mechanism, w.now.terms, system.v));
        out.energy.push_back(potential_energy(p.mechanism, w.now.terms));
        append(out.energy, y.segment(system.nq + system.nv + system.nz, system.nw));
        if (!p.gaps.empty()) out.energy.push_back(jumps.impacts);
        out.energy.push_back(jumps.projection);
    }
    if (options.forces) {
        record_contacts();
        split_forces(p, w, split_);
        append(out.F_ideal, split_.F_ideal);
        append(out.F_nonideal, split_.F_nonideal);
        append(out.lam, split_.lam);
        append(out.lam_ideal, split_.lam_ideal);
    }
}

}  // namespace pn
