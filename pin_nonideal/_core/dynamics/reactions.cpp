#include "dynamics/reactions.hpp"

#include <algorithm>
#include <bitset>

#include "constraints/redundancy.hpp"
#include "dynamics/law_forces.hpp"
#include "math/nnls.hpp"
#include "math/tolerances.hpp"

namespace pn {

// Sum the external forces on each body: given forces, multipliers, friction and the other laws that act on bodies.
static void gather_body_forces(const Program& p, Workspace& w, std::vector<Force>& body) {
    const Evaluation& now = w.now;
    if (p.has_body_forces) std::copy(now.body_force.begin(), now.body_force.end(), body.begin());
    else std::fill(body.begin(), body.end(), Force{Vec3::Zero(), Vec3::Zero()});
    for (int i : now.active_blocks) {  // constraints, and sticking elements at an anchor or contact
        const Block& block = p.blocks[i];
        if (!now.values[i].geometric) continue;
        for (int k = 0; k < block.total; ++k) {
            const int kept = p.described.rows[block.user_row + k].kept;
            if (kept < 0 || !now.rows.required[kept]) continue;
            add_wrench(block, now.terms, now.values[i].wrench[k], p.share(block, k, now.reactions.lam), body);
        }
    }
    if (now.ideal) return;
    for (size_t e = 0; e < p.frictions.size(); ++e) {  // slipping elements, and forces tried during the mode search
        const Friction& f = p.frictions[e];
        if (w.state.mode[e] == sticking || now.is_inactive[f.block] || !now.values[f.block].geometric) continue;
        for (int k = 0; k < f.dim; ++k)
            add_wrench(p.blocks[f.block], now.terms, now.values[f.block].wrench[k], now.slip_force[e][k], body);
    }
    add_body_forces(p, w, body);
}

// Recursive Newton-Euler: motion of the bodies from the roots outward, momentum and external forces of subtrees back.
static void sweep_tree(const Mechanism& m, const Evaluation& now, Reactions& r) {
    const int n = static_cast<int>(m.joints.size());
    for (int i = 0; i < n; ++i) r.momentum[i] = {Vec3::Zero(), Vec3::Zero()};
    r.motion[0] = {Vec3::Zero(), Vec3::Zero()};
    for (int i = 1; i < n; ++i) {
        const Joint& j = m.joints[i];
        Motion motion = r.motion[j.parent];
        if (j.deep) motion = further(motion, now.terms.deep.shift[i]);
        for (int k = j.iv; k < j.iv + j.nv; ++k) motion += now.a[k] * now.terms.J[k];
        r.motion[i] = motion;
    }
    for (int i = n - 1; i > 0; --i) {
        const Joint& j = m.joints[i];
        if (j.deep) {  // body by body: differences of subtree sums would cancel
            r.momentum[i] += now.terms.body[i].inertia * r.motion[i];
            r.momentum[i] += now.terms.deep.bias[i];
            r.momentum[i] -= r.body[i];
            if (j.parent != 0) r.momentum[j.parent] += before(r.momentum[i], now.terms.deep.shift[i]);
            continue;
        }
        for (int k = j.iv; k < j.iv + j.nv; ++k)
            r.momentum[i] += Force{now.a[k] * now.terms.Ag[k].lin, now.a[k] * now.terms.Ag[k].ang};
        if (j.parent == 0) continue;
        r.momentum[j.parent] += r.momentum[i];
        r.body[j.parent] += r.body[i];
    }
}

// Maximum number of load-sharing contacts for which all zero-load sets are tried.
static constexpr size_t max_sharing_contacts = 6;

// If the minimum-norm multipliers need tension in a contact, replace them by the minimum-norm ones without tension. If
// none exist, minimize the tension.
static void press_all(const Program& p, Workspace& w, Reactions& r) {
    const Evaluation& now = w.now;
    std::vector<int> gaps;
    bool pulls = false;
    for (int i : now.closed_gaps) {
        const Block& block = p.blocks[p.gaps[i].block];
        if (block.kept.empty()) continue;
        gaps.push_back(i);
        pulls |= r.lam[block.row] < 0.0;
    }
    r.loads_are_feasible = true;
    if (!r.is_zero_load_set_frozen) {
        r.has_zero_load.assign(p.gaps.size(), 0);
        if (!pulls) return;
    }
    const FreeMultipliers free = free_multipliers(p.blocks, now.B, p.described, w.now.rows);
    MatX Z(gaps.size(), free.count());
    VecX N(gaps.size());
    std::vector<char> has_zero_load(gaps.size());
    for (size_t k = 0; k < gaps.size(); ++k) {
        const int row = p.blocks[p.gaps[gaps[k]].block].row;
        Z.row(k) = free.of_row(row).transpose();
        if (!(Z.row(k).norm() > min_null_space_entry)) Z.row(k).setZero();
        N[k] = r.lam[row];
        has_zero_load[k] = r.has_zero_load[gaps[k]];
    }
    if (r.is_zero_load_set_frozen) {
        free.add(shortest_with_zeros(Z, N, has_zero_load), r.lam);
        return;
    }
    const NonnegativeSum found = shortest_nonnegative(Z, N);
    free.add(found.z, r.lam);
    r.loads_are_feasible = found.is_feasible;
    for (size_t k = 0; k < gaps.size(); ++k) {
        r.has_zero_load[gaps[k]] = found.held[k];
        double& load = r.lam[p.blocks[p.gaps[gaps[k]].block].row];
        if (found.is_feasible) load = found.held[k] ? 0.0 : std::max(load, 0.0);
    }
}

std::vector<std::vector<char>> zero_load_sets(const Program& p, const Workspace& w) {
    std::vector<int> sharing;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i)
        if (w.state.closed[i] && !p.blocks[p.gaps[i].block].kept.empty()) sharing.push_back(i);
    std::vector<std::vector<char>> sets;
    if (sharing.size() > max_sharing_contacts) return sets;
    const size_t free = dependent_rows(w.now.rows).size();
    for (unsigned bits = 0; bits < 1u << sharing.size(); ++bits) {
        // more loads than the null space's dimension vanish only by coincidence
        if (std::bitset<max_sharing_contacts>(bits).count() > free) continue;
        std::vector<char>& has_zero_load = sets.emplace_back(p.gaps.size(), 0);
        for (size_t k = 0; k < sharing.size(); ++k) has_zero_load[sharing[k]] = bits >> k & 1;
    }
    return sets;
}

const Reactions& reactions(const Program& p, Workspace& w) {
    Reactions& r = w.now.reactions;
    if (r.current) return r;
    r.current = true;
    r.swept = false;
    share_multipliers(p.blocks, w.now.B, p.described, w.now.rows, w.now.lam, r.lam);
    r.loads_are_feasible = true;
    if (shares_contact_loads(p, w)) press_all(p, w, r);
    return r;
}

double normal_force(const Program& p, Workspace& w, int contact) {
    return p.described.share(p.pressing[contact], reactions(p, w).lam);
}

PullMargin contact_pull_margin(const Program& p, Workspace& w, int contact) {
    const VecX& shared = reactions(p, w).lam;
    return press(p.blocks, w.now.B, p.described, p.pressing, w.now.rows, shared, contact);
}

void sum_subtree_forces(const Program& p, Workspace& w, std::vector<Force>& body) {
    gather_body_forces(p, w, body);
    for (size_t i = body.size(); i-- > 1;) {
        const Joint& j = p.mechanism.joints[i];
        if (!j.deep && j.parent != 0) body[j.parent] += body[i];
    }
}

Force joint_wrench(const Program& p, Workspace& w, int joint) {
    reactions(p, w);
    Reactions& r = w.now.reactions;
    if (!r.swept) {
        r.swept = true;
        gather_body_forces(p, w, r.body);
        sweep_tree(p.mechanism, w.now, r);
    }
    const Body& b = w.now.terms.body[joint];
    if (p.mechanism.joints[joint].deep) return r.momentum[joint];
    const int parent = p.mechanism.joints[joint].parent;
    Force f = b.f;
    f += r.momentum[joint];
    if (parent != 0) f += b.Y * r.motion[parent];
    f.lin -= r.body[joint].lin;
    f.ang -= r.body[joint].ang;
    f.ang -= b.p.cross(f.lin);  // from the reference point to the joint's origin
    return f;
}

Force anchor_wrench(const Program& p, Workspace& w, int index) {
    const Reactions& r = reactions(p, w);
    const Block& block = p.blocks[index];
    const RowValues& values = w.now.values[index];
    Force f{Vec3::Zero(), Vec3::Zero()};
    for (int k = 0; k < block.total; ++k) {
        if (!values.geometric) continue;
        const Wrench& unit = values.wrench[k];
        const double lam = p.share(block, k, r.lam);
        f.lin += lam * unit.force;
        f.ang += lam * unit.couple;
    }
    return f;
}

namespace {

// Forces along rows as one wrench about a point.
struct WrenchAbout {
    const Evaluation& now;
    Vec3 origin;
    Force sum{Vec3::Zero(), Vec3::Zero()};

    void add(int block, int row, double size) {
        if (!now.values[block].geometric) return;
        const Wrench& unit = now.values[block].wrench[row];
        const Vec3 force = size * unit.force;
        sum += Force{force, size * unit.couple + (unit.point - origin).cross(force)};
    }
    void along(int block, const Vec3& f) {
        for (int k = 0; k < now.values[block].rows; ++k) add(block, k, f[k]);
    }
    void on_dof(int, double) {}
};

}  // namespace

Force carried_wrench(const Program& p, Workspace& w, int index) {
    if (w.now.is_inactive[index]) return {Vec3::Zero(), Vec3::Zero()};
    const Reactions& r = reactions(p, w);
    const Evaluation& now = w.now;
    const Block& block = p.blocks[index];
    const Frame& frame = *frames(block.kind).first;
    const Body& body = now.terms.body[frame.joint];
    WrenchAbout wrench{now, body.ref + body.p + body.R * frame.p};
    for (int k = 0; k < block.total; ++k) wrench.add(index, k, p.share(block, k, r.lam));
    for (int e : now.loaded_elements) {
        const Friction& f = p.frictions[e];
        if (f.anchor != index) continue;
        for (int k = 0; k < f.dim; ++k)
            wrench.add(f.block, k, w.state.mode[e] == sticking ? r.lam[p.blocks[f.block].row + k] : now.slip_force[e][k]);
    }
    const LawState state{now.terms, now.values, now.v, w.state.z, now.user_C};
    each_law<Viscous>(p.laws, [&](const Viscous& law) { if (law.anchor == index) law.act(state, wrench); });
    return wrench.sum;
}

}  // namespace pn
