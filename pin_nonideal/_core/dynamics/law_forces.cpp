#include "dynamics/law_forces.hpp"

#include <algorithm>

namespace pn {

namespace {

// Collects forces as generalized forces, and rates of the laws' states if required.
struct GeneralizedForce {
    const Program& p;
    const Evaluation& now;
    VecX& C;
    VecX* dz = nullptr;

    void on_dof(int dof, double force) { C[dof] += force; }
    void on_body(int joint, Force f) {
        for (int i = joint; i != 0; i = p.mechanism.joints[i].parent) {
            const Joint& j = p.mechanism.joints[i];
            for (int dof = j.iv; dof < j.iv + j.nv; ++dof) C[dof] += dot(now.terms.J[dof], f);
            if (j.deep) f = before(f, now.terms.deep.shift[i]);
        }
    }
    void along(int block, const Vec3& f) { add_along(p.blocks[block], now.A, f, C); }
    void on_all(const VecX& force) { C += force; }
    void on_state(int state, double rate) { if (dz) (*dz)[state] = rate; }
};

// Collects forces on bodies about their reference points. A force inside a tree joint does not count.
struct BodyForces {
    const Program& p;
    const Evaluation& now;
    std::vector<Force>& body;

    void on_dof(int, double) {}
    void on_body(int joint, const Force& f) { body[joint] += f; }
    void along(int block, const Vec3& f) {
        const RowValues& values = now.values[block];
        if (!values.geometric) return;
        for (int k = 0; k < values.rows; ++k) add_wrench(p.blocks[block], now.terms, values.wrench[k], f[k], body);
    }
    void on_all(const VecX&) {}
    void on_state(int, double) {}
};

// Collects the dofs on which a law may act.
struct ActedDofs {
    const Program& p;
    std::vector<char>& dofs;

    void on_dof(int dof, double) { dofs[dof] = 1; }
    void on_body(int joint, const Force&) {
        for (int dof : p.mechanism.dofs_of(joint)) dofs[dof] = 1;
    }
    void along(int block, const Vec3&) {
        for (int dof : p.blocks[block].support()) dofs[dof] = 1;
    }
    void on_all(const VecX&) { std::fill(dofs.begin(), dofs.end(), char(1)); }
    void on_state(int, double) {}
};

LawState law_state(const Workspace& w, const VecX& v) {
    return {w.now.terms, w.now.values, v, w.state.z, w.now.user_C};
}

}  // namespace

const VecX& user_law_force(const Program& p, const UserLaw& law, Workspace& w, double t, const VecX& q, const VecX& v) {
    VecX& C = w.now.user_C[law.index];
    law.function(p, t, q, v, w, C, w.state.z.data() + law.state, w.now.dz.data() + law.state);
    return C;
}

void add_smooth_forces(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, VecX& C) {
    if (p.user_laws > 0)
        each_law<UserLaw>(p.laws, [&](const UserLaw& law) {
            if (law.reaction == Reaction::none) user_law_force(p, law, w, t, q, v);
        });
    GeneralizedForce sink{p, w.now, C, &w.now.dz};
    const LawState state = law_state(w, v);
    for (const Law& each : p.laws)
        std::visit([&](const auto& law) {
            if (law.reaction == Reaction::none) law.act(state, sink);  // Eq. (9)
        }, each);
}

std::vector<std::vector<int>> law_supports(const Program& p) {
    const Workspace anywhere(p);
    std::vector<std::vector<char>> on(p.law_names.size(), std::vector<char>(p.mechanism.nv, 0));
    for (const Law& each : p.laws)
        std::visit([&](const auto& law) {
            ActedDofs sink{p, on[law.law]};
            law.act(law_state(anywhere, anywhere.now.v), sink);
        }, each);
    for (const Friction& f : p.frictions) ActedDofs{p, on[f.law]}.along(f.block, Vec3::Zero());
    std::vector<std::vector<int>> supports(on.size());
    for (size_t l = 0; l < on.size(); ++l)
        for (int dof = 0; dof < p.mechanism.nv; ++dof)
            if (on[l][dof]) supports[l].push_back(dof);
    return supports;
}

void add_forces_by_law(const Program& p, const Workspace& w, const VecX& v, LawForceList& force) {
    const LawState state = law_state(w, v);
    for (const Law& each : p.laws)
        std::visit([&](const auto& law) {
            GeneralizedForce sink{p, w.now, force[law.law]};
            law.act(state, sink);
        }, each);
}

void add_law_forces(const Program& p, const Workspace& w, const VecX& v, VecX& C) {
    GeneralizedForce sink{p, w.now, C};
    const LawState state = law_state(w, v);
    for (const Law& each : p.laws) std::visit([&](const auto& law) { law.act(state, sink); }, each);
}

void add_body_forces(const Program& p, const Workspace& w, std::vector<Force>& body) {
    BodyForces sink{p, w.now, body};
    const LawState state = law_state(w, w.now.v);
    for (const Law& each : p.laws) std::visit([&](const auto& law) { law.act(state, sink); }, each);
}

}  // namespace pn
