#include "dynamics/power.hpp"

#include <algorithm>

#include "dynamics/law_forces.hpp"
#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/acceleration.hpp"

namespace pn {

int power_count(const Program& p) { return first_law_power + static_cast<int>(p.law_names.size()); }

std::vector<std::string> power_names(const Program& p) {
    std::vector<std::string> names(std::begin(scene_powers), std::end(scene_powers));
    names.insert(names.end(), p.law_names.begin(), p.law_names.end());
    return names;
}

// Compute C of each law without sticking forces, which have no power.
static void moving_law_forces(const Program& p, const Workspace& w, const VecX& v, LawForceList& force) {
    force.clear();
    add_forces_by_law(p, w, v, force);
    for (int e : w.now.slipping) add_current_slip_force(p, w, e, force[p.frictions[e].law]);
}

void law_forces(const Program& p, Workspace& w, const VecX& v, LawForceList& force) {
    moving_law_forces(p, w, v, force);
    for (int e : w.now.loaded_elements) {
        if (w.state.mode[e] != sticking) continue;
        const Friction& f = p.frictions[e];
        const Block& block = p.blocks[f.block];
        if (is_locked(w, block))
            for (int k = 0; k < f.dim; ++k) force[f.law][block.dof + k] += holding_forces(p, w)[block.dof + k];
        else if (w.now.rows.block_used[f.block])
            add_transpose(block, w.now.A, reactions(p, w).lam, force[f.law]);
    }
}

void powers(const Program& p, Workspace& w, const VecX& v, double* out) {
    out[0] = p.driven ? v.dot(w.now.tau) : 0.0;
    out[1] = p.driven ? v.dot(w.now.external) : 0.0;
    out[2] = 0.0;
    if (!w.now.rows.blocks.empty()) {
        w.scratch.work.setZero();
        for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.A, w.now.lam, w.scratch.work);
        out[2] = v.dot(w.scratch.work);
    }
    if (!p.has_laws()) return;
    std::fill_n(out + first_law_power, p.law_names.size(), 0.0);
    if (p.has_contact_friction_only && w.now.slipping.empty()) return;
    LawForceList& force = w.scratch.law_force;
    moving_law_forces(p, w, v, force);
    for (int law : force.acting()) out[first_law_power + law] = v.dot(force[law]);
}

}  // namespace pn
