#include "friction/laws.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"

namespace pn {

namespace {

// Adds to C, and to the law's own share when the ledger asks for it.
void add(Workspace& w, VecX& C, int law, int dof, double force) {
    C[dof] += force;
    if (w.now.want_laws) w.now.law_force[law][dof] += force;
}

// Force f along the directions of a block, as a generalized force: C += A^T f.
void add_along(const Program& p, Workspace& w, VecX& C, int law, int block_index, const Vec3& f) {
    const Block& block = p.blocks[block_index];
    const int n = static_cast<int>(block.kept.size());
    const double* A = w.now.A.data() + block.offset;
    for (size_t l = 0; l < block.support.size(); ++l) {
        double sum = 0.0;
        for (int k = 0; k < n; ++k) sum += A[l * n + k] * f[k];
        if (sum != 0.0) add(w, C, law, block.support[l], sum);
    }
}

// Slip slower than this part of the scene's speed has no direction of its own but rounding.
constexpr double directed_speed = 1e-9;

// Unit direction of the friction force of a slipping element.
Vec3 force_direction(const Program& p, Workspace& w, size_t e, double scene_speed) {
    const Friction& f = p.frictions[e];
    if (f.dim == 1) return Vec3(-w.state.mode[e], 0.0, 0.0);
    const Vec3 u = slip_velocity(w, f);
    const double speed = u.norm();
    if (speed > directed_speed * (1.0 + scene_speed))
        // Past a reversal inside a step the direction goes on as it was, so that the step sees a smooth law.
        w.state.last_direction[e] = u.dot(w.state.slip_direction[e]) >= 0.0 ? Vec3(u / speed) : Vec3(-u / speed);
    return -w.state.last_direction[e];
}

bool load_dependent(const Friction& f) { return f.reaction != Reaction::none; }

}  // namespace

Vec3 slip_velocity(const Workspace& w, const Friction& f) {
    const RowValues& values = w.now.values[f.block];
    Vec3 u = Vec3::Zero();
    for (int k = 0; k < f.dim; ++k) u[k] = values.rate[k];
    return u;
}

Force joint_wrench(const Program& p, const Workspace& w, int joint) {
    const Body& b = w.now.terms.body[joint];
    const int parent = p.mechanism.joints[joint].parent;
    Force f = b.f;
    f += w.now.momentum[joint];
    if (parent != 0) f += b.Y * w.now.motion[parent];
    f.lin -= w.now.reaction_body[joint].lin;
    f.ang -= w.now.reaction_body[joint].ang;
    f.ang -= b.p.cross(f.lin);  // from the reference point to the joint's origin
    return f;
}

Force anchor_wrench(const Program& p, const Workspace& w, int index) {
    const Block& block = p.blocks[index];
    const RowValues& values = w.now.values[index];
    Force f{Vec3::Zero(), Vec3::Zero()};
    for (size_t k = 0; k < block.kept.size(); ++k) {
        if (!values.geometric) continue;
        const Wrench& unit = values.wrench[block.kept[k]];
        const double lam = w.now.lam_shared[block.row + k];
        f.lin += lam * unit.force;
        f.ang += lam * unit.couple;
    }
    return f;
}

double speed_factor(const Friction& f, double speed) {
    if (f.static_ratio == 1.0 || f.stribeck_velocity == 0.0) return 1.0;
    const double x = speed / f.stribeck_velocity;
    return 1.0 + (f.static_ratio - 1.0) * std::exp(-x * x);
}

double load_limit(const Program& p, Workspace& w, const Friction& f, double t, const VecX& q, const VecX& v) {
    switch (f.load) {
        case Friction::Load::none: return f.constant;
        case Friction::Load::user: return f.user_limit(t, q, v, w);
        case Friction::Load::contact: return f.constant + f.mu * std::abs(w.now.lam_shared[p.blocks[f.anchor].row]);
        default: break;
    }
    Force r;
    Vec3 axis;
    if (f.joint > 0) {
        r = joint_wrench(p, w, f.joint);
        axis = w.now.terms.body[f.joint].R * f.axis;
    } else {
        r = anchor_wrench(p, w, f.anchor);
        const Frame& frame = *frame1(p.blocks[f.anchor].kind);
        axis = w.now.terms.body[frame.joint].R * (frame.R * f.axis);
    }
    if (f.load == Friction::Load::spherical) return f.constant + f.mu * f.radius * r.lin.norm();
    const double axial = r.lin.dot(axis);
    const double radial = (r.lin - axial * axis).norm();
    if (f.load == Friction::Load::prismatic)
        return f.constant + f.mu * (radial + f.inverse_span * r.ang.norm());
    const double bending = f.inverse_span == 0.0 ? 0.0 : (r.ang - r.ang.dot(axis) * axis).norm() * f.inverse_span;
    return f.constant + f.mu * (f.radius * (radial + bending) + f.axial_radius * std::abs(axial));
}

// Force of a drag on its body, about the body's reference point.
static Force drag_force(const Workspace& w, const Drag& d) {
    const Body& body = w.now.terms.body[d.frame.joint];
    const Vec3 x = body.ref + body.p + body.R * d.frame.p, u = velocity_at(body, x);
    const double speed = u.norm();
    if (speed == 0.0 || d.frame.joint == 0) return {Vec3::Zero(), Vec3::Zero()};
    const Vec3 force = -d.coefficient * std::pow(speed, d.exponent - 1.0) * u;
    return {force, (x - body.ref).cross(force)};
}

// Laws of the state alone.
static void state_laws(const Program& p, Workspace& w, const VecX& v, VecX& C) {
    for (const Viscous& x : p.viscous) {
        if (x.dof >= 0) {
            for (int k = x.dof; k < x.dof + x.count; ++k) add(w, C, x.law, k, -x.coefficient * v[k]);
        } else {
            const double u = w.now.values[x.block].rate[0];
            add_along(p, w, C, x.law, x.block, Vec3(-x.coefficient * u, 0.0, 0.0));
        }
    }
    for (const Sigmoid& s : p.sigmoids) {
        const double here = s.phi1 / (1.0 + std::exp(-s.phi2 * (v[s.dof] + s.phi3)));
        const double rest = s.phi1 / (1.0 + std::exp(-s.phi2 * s.phi3));
        add(w, C, s.law, s.dof, rest - here);
    }
    for (const Bristle& b : p.bristles) {
        const double speed = v[b.dof], x = speed / b.stribeck_velocity;
        const double g = b.coulomb + (b.stiction - b.coulomb) * std::exp(-x * x);
        const double rate = speed - b.sigma0 * std::abs(speed) / g * w.state.z[b.state];
        w.now.dz[b.state] = rate;
        add(w, C, b.law, b.dof, -(b.sigma0 * w.state.z[b.state] + b.sigma1 * rate + b.sigma2 * speed));
    }
    for (const Drag& d : p.drags) {
        const Force f = drag_force(w, d);
        for (int dof : d.dofs) add(w, C, d.law, dof, dot(w.now.terms.J[dof], f));
    }
}

void smooth_laws(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    VecX& C = w.now.C_smooth;
    C.setZero();
    state_laws(p, w, v, C);
    for (size_t i = 0; i < p.user_laws.size(); ++i) {
        const UserLaw& law = p.user_laws[i];
        if (law.reaction != Reaction::none) continue;
        law.function(t, q, v, w, w.now.user_C[i], w.state.z.data() + law.state, w.now.dz.data() + law.state);
        C += w.now.user_C[i];
    }
    for (size_t e = 0; e < p.frictions.size(); ++e) {
        const Friction& f = p.frictions[e];
        if (load_dependent(f)) continue;
        w.now.load[e] = load_limit(p, w, f, t, q, v);
        w.now.limit[e] = w.now.load[e] * speed_factor(f, w.state.mode[e] == 0 ? 0.0 : slip_velocity(w, f).norm());
    }
    add_slip_forces(p, w, C, false);
}

void law_forces(const Program& p, Workspace& w, const VecX& v) {
    for (VecX& f : w.now.law_force) f.setZero();
    w.now.want_laws = true;
    state_laws(p, w, v, w.scratch.work);
    add_slip_forces(p, w, w.scratch.work, false);
    add_slip_forces(p, w, w.scratch.work, true);
    w.now.want_laws = false;
    for (size_t i = 0; i < p.user_laws.size(); ++i) w.now.law_force[p.user_laws[i].law] += w.now.user_C[i];
}

void add_slip_forces(const Program& p, Workspace& w, VecX& C, bool dependent) {
    for (size_t e = 0; e < p.frictions.size(); ++e) {
        const Friction& f = p.frictions[e];
        if (load_dependent(f) != dependent || !slips(w.state.mode[e])) continue;
        w.now.slip_force[e] = w.now.limit[e] * force_direction(p, w, e, w.now.speed);
        if (const auto* d = std::get_if<DofRows>(&p.blocks[f.block].kind)) {
            for (int k = 0; k < d->count; ++k) add(w, C, f.law, d->dof + k, w.now.slip_force[e][k]);
        } else {
            add_along(p, w, C, f.law, f.block, w.now.slip_force[e]);
        }
    }
}

void gather_reactions(const Program& p, Workspace& w, bool nonideal) {
    share_multipliers(p, w);
    if (!p.needs_joint_reactions) return;
    const Mechanism& m = p.mechanism;
    const int n = static_cast<int>(m.joints.size());
    if (p.has_body_forces) std::copy(w.now.body_force.begin(), w.now.body_force.end(), w.now.reaction_body.begin());
    else std::fill(w.now.reaction_body.begin(), w.now.reaction_body.end(), Force{Vec3::Zero(), Vec3::Zero()});
    const auto apply = [&](const Block& block, const Wrench& unit, double size) {
        for (int side = 0; side < 2; ++side) {
            const int joint = side == 0 ? block.joint1 : block.joint2;
            if (joint == 0) continue;
            const double s = side == 0 ? size : -size;
            const Vec3 force = s * unit.force;
            w.now.reaction_body[joint] +=
                Force{force, s * unit.couple + (unit.point - w.now.terms.body[joint].ref).cross(force)};
        }
    };
    for (int i : w.now.rows.blocks) {  // multipliers of constraints, and of what sticks at an anchor or contact
        const Block& block = p.blocks[i];
        if (!w.now.values[i].geometric) continue;
        for (size_t k = 0; k < block.kept.size(); ++k)
            apply(block, w.now.values[i].wrench[block.kept[k]], w.now.lam_shared[block.row + k]);
    }
    if (nonideal) {
        for (size_t e = 0; e < p.frictions.size(); ++e) {  // what slips there, or is tried while modes are sought
            const Friction& f = p.frictions[e];
            if (w.state.mode[e] == sticking || !w.now.values[f.block].geometric) continue;
            for (int k = 0; k < f.dim; ++k) apply(p.blocks[f.block], w.now.values[f.block].wrench[k], w.now.slip_force[e][k]);
        }
        for (const Viscous& x : p.viscous)  // and the other laws that act on bodies
            if (x.block >= 0)
                apply(p.blocks[x.block], w.now.values[x.block].wrench[0], -x.coefficient * w.now.values[x.block].rate[0]);
        for (const Drag& d : p.drags) w.now.reaction_body[d.frame.joint] += drag_force(w, d);
    }
    for (int i = 0; i < n; ++i) w.now.momentum[i] = {Vec3::Zero(), Vec3::Zero()};
    w.now.motion[0] = {Vec3::Zero(), Vec3::Zero()};
    for (int i = 1; i < n; ++i) {
        const Joint& j = m.joints[i];
        w.now.motion[i] = w.now.motion[j.parent];
        for (int k = j.iv; k < j.iv + j.nv; ++k) w.now.motion[i] += w.now.a[k] * w.now.terms.J[k];
    }
    for (int i = n - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        for (int k = j.iv; k < j.iv + j.nv; ++k)
            w.now.momentum[i] += Force{w.now.a[k] * w.now.terms.Ag[k].lin, w.now.a[k] * w.now.terms.Ag[k].ang};
        if (j.parent == 0) continue;
        w.now.momentum[j.parent] += w.now.momentum[i];
        w.now.reaction_body[j.parent] += w.now.reaction_body[i];
    }
}

}  // namespace pn
