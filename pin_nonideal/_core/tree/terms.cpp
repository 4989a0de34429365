#include "tree/terms.hpp"

#include "tree/articulated.hpp"
#include "tree/lie_group.hpp"

namespace pn {

void Terms::allocate(const Mechanism& m) {
    body.assign(m.joints.size(), Body{});
    body[0].a = {-m.gravity, Vec3::Zero()};
    J.assign(m.nv, Motion{Vec3::Zero(), Vec3::Zero()});
    Ag.assign(m.nv, Force{Vec3::Zero(), Vec3::Zero()});
    nle = VecX::Zero(m.nv);
    L.assign(m.row_entries, 0.0);
    M.assign(m.row_entries, 0.0);
    D = VecX::Zero(m.nv);
    inv_sqrt_D = VecX::Zero(m.nv);
    locked.assign(m.nv, 0);
    q = VecX::Zero(m.nq);
    deep.shift.assign(m.joints.size(), Vec3::Zero());
    if (!m.deep_joints.empty()) {
        deep.bias.assign(m.joints.size(), Force{Vec3::Zero(), Vec3::Zero()});
        deep.forces = deep.bias;
        deep.gain.assign(m.nv, Force{Vec3::Zero(), Vec3::Zero()});
        deep.motions.assign(m.joints.size(), Motion{Vec3::Zero(), Vec3::Zero()});
        deep.inertia.assign(m.joints.size(), ArticulatedInertia{});
    }
    if (m.provider == Provider::pinocchio) pass.emplace<PinocchioPass>(m);
    else pass.emplace<NativePass>(m);
}

void place_bodies(const Mechanism& m, Terms& terms, const VecX& q, const std::vector<int>& joints,
                  const std::vector<Angle>& angles) {
    terms.q = q;
    normalize(m, terms.q.data());
    std::visit([&](auto& pass) { place_bodies(m, pass, terms, joints, angles); }, terms.pass);
}

void place_bodies(const Mechanism& m, Terms& terms, const VecX& q) {
    terms.q = q;
    normalize(m, terms.q.data());
    std::visit([&](auto& pass) { place_bodies(m, pass, terms); }, terms.pass);
}

void move_bodies(const Mechanism& m, Terms& terms, const VecX& v) {
    std::visit([&](auto& pass) { move_bodies(m, pass, terms, v); }, terms.pass);
}

void mass_matrix(const Mechanism& m, Terms& terms) {
    std::visit([&](auto& pass) { mass_matrix(m, pass, terms); }, terms.pass);
}

void bias_forces(const Mechanism& m, Terms& terms) {
    std::visit([&](auto& pass) { bias_forces(m, pass, terms); }, terms.pass);
}

void kinematics(const Mechanism& m, Terms& terms, const VecX& q, const VecX& v) {
    place_bodies(m, terms, q);
    move_bodies(m, terms, v);
}

void inertia(const Mechanism& m, Terms& terms) {
    mass_matrix(m, terms);
    bias_forces(m, terms);
}

double kinetic_energy(const Mechanism& m, Terms& terms, const VecX& v) {
    double twice = 0.0;
    move_articulated(m, terms, v);
    for (int i : m.deep_joints) twice += dot(terms.deep.motions[i], terms.body[i].inertia * terms.deep.motions[i]);
    for (int dof : m.deep_dofs) twice += m.armature[dof] * v[dof] * v[dof];
    for (int k = 0; k < m.nv; ++k) {
        if (m.is_deep[k]) continue;
        const double* row = terms.M.data() + m.row_offset[k];
        double sum = 0.5 * row[0] * v[k];
        for (int i = m.dof_parent[k], s = 1; i >= 0; i = m.dof_parent[i], ++s) sum += row[s] * v[i];
        twice += 2.0 * sum * v[k];
    }
    return 0.5 * twice;
}

double potential_energy(const Mechanism& m, const Terms& terms) {
    double energy = 0.0;
    for (size_t i = 1; i < m.joints.size(); ++i) {
        const Body& b = terms.body[i];
        const Vec3 com = b.ref + b.p + b.R * m.joints[i].com;
        energy -= m.joints[i].mass * m.gravity.dot(com);
    }
    return energy;
}

}  // namespace pn
