// What a scene consists of, laid out for the evaluation, and the room that it works in.
#include <algorithm>

#include "dynamics/program.hpp"

namespace pn {

namespace {

// Support of a block: the dofs of its rows and all their ancestors, descending.
void find_support(const Mechanism& m, const std::vector<int>& dofs, Block& block) {
    std::vector<char> in(m.nv, 0);
    for (int dof : dofs)
        for (int d = dof; d >= 0 && !in[d]; d = m.dof_parent[d]) in[d] = 1;
    std::vector<int> place(m.nv, -1);
    for (int d = m.nv - 1; d >= 0; --d)
        if (in[d]) {
            place[d] = static_cast<int>(block.support.size());
            block.support.push_back(d);
        }
    for (int d : block.support) block.parent.push_back(m.dof_parent[d] < 0 ? -1 : place[m.dof_parent[d]]);
    if (!is_geometric(block.kind)) return;
    // A differs from zero only on dofs that move one body and not the other.
    const std::vector<int> d1 = m.dofs_of(block.joint1), d2 = m.dofs_of(block.joint2);
    for (int d : d1)
        if (std::find(d2.begin(), d2.end(), d) == d2.end()) block.entries.push_back({place[d], d, 1.0});
    for (int d : d2)
        if (std::find(d1.begin(), d1.end(), d) == d1.end()) block.entries.push_back({place[d], d, -1.0});
}

std::vector<int> moved_dofs(const Mechanism& m, const Block& block) {
    if (is_geometric(block.kind)) {
        std::vector<int> dofs = m.dofs_of(block.joint1);
        for (int d : m.dofs_of(block.joint2)) dofs.push_back(d);
        return dofs;
    }
    if (const auto* c = std::get_if<CouplingRows>(&block.kind))
        return {m.joints[c->joint1].iv, m.joints[c->joint2].iv};
    if (const auto* c = std::get_if<MotionRows>(&block.kind)) return {m.joints[c->joint].iv};
    if (const auto* c = std::get_if<DofRows>(&block.kind)) {
        std::vector<int> dofs;
        for (int k = 0; k < c->count; ++k) dofs.push_back(c->dof + k);
        return dofs;
    }
    std::vector<int> all(m.nv);
    for (int k = 0; k < m.nv; ++k) all[k] = k;
    return all;
}

}  // namespace

void Program::finish() {
    int row = 0;
    entries = 0;
    for (size_t i = 0; i < blocks.size(); ++i) {
        Block& block = blocks[i];
        block.values = static_cast<int>(i);
        block.comparable_rows = std::holds_alternative<PointRows>(block.kind);
        block.row = row;
        row += static_cast<int>(block.kept.size());
        block.support.clear();
        block.parent.clear();
        block.entries.clear();
        find_support(mechanism, moved_dofs(mechanism, block), block);
        block.offset = static_cast<int>(entries);
        entries += block.support.size() * block.kept.size();
    }
    layout = layout_rows(blocks, mechanism.nv);
    std::vector<char> reached(mechanism.nv, 0);
    for (Block& block : blocks) {
        for (int dof : block.support) reached[dof] = 1;
        block.holonomic.clear();
        for (int k : block.kept) block.holonomic.push_back(has_residual(block.kind, k));
    }
    touched_dofs.clear();
    for (int dof = 0; dof < mechanism.nv; ++dof)
        if (reached[dof]) touched_dofs.push_back(dof);
    // A contact whose normal nothing moves along has no row: it carries nothing and never pulls.
    const auto bare = [&](int block) { return blocks[block].kept.empty(); };
    contacts.erase(std::remove_if(contacts.begin(), contacts.end(), bare), contacts.end());
    for (Friction& f : frictions)
        if (f.load == Friction::Load::contact && bare(f.anchor)) f.load = Friction::Load::none;
    for (const Friction& f : frictions) {
        needs_reactions |= f.reaction != Reaction::none;
        needs_joint_reactions |= f.reaction != Reaction::none && f.joint > 0;
    }
    // Kinds stand together, so that the order of their descriptions decides no sum.
    std::stable_sort(laws.begin(), laws.end(), [](const Law& a, const Law& b) { return a.index() < b.index(); });
    each_law<UserLaw>(laws, [&](const UserLaw& law) {
        needs_reactions |= law.reaction != Reaction::none;
        needs_joint_reactions |= law.reaction != Reaction::none;
    });
    each_law<Drag>(laws, [&](Drag& drag) { drag.dofs = mechanism.dofs_of(drag.frame.joint); });
    for (const Friction& f : frictions) needs_joint_reactions |= f.load == Friction::Load::user;
    for (int i = 0; i < constraints; ++i) {
        moves_in_time |= pn::moves_in_time(blocks[i].kind);
        affine_rates &= !std::holds_alternative<UserRows>(blocks[i].kind);
    }
    std::vector<char> touched(mechanism.joints.size(), 0);
    for (int i = 0; i < constraints; ++i)
        for (int joint : {blocks[i].joint1, blocks[i].joint2})
            for (; joint != 0; joint = mechanism.joints[joint].parent) touched[joint] = 1;
    touched_joints.clear();
    for (size_t joint = 1; joint < touched.size(); ++joint)
        if (touched[joint]) touched_joints.push_back(static_cast<int>(joint));
    touched_angles.clear();
    for (const Angle& angle : mechanism.angles)
        if (touched[angle.joint]) touched_angles.push_back(angle);
    driven = !forces.empty() || !std::holds_alternative<NoActuation>(actuation);
    asks_functions = std::holds_alternative<TorqueFunction>(actuation) || user_laws > 0 || moves_in_time;
    for (const Friction& f : frictions) asks_functions |= f.user_limit != nullptr;
    for (const GivenForce& each : forces)
        std::visit([&](const auto& f) {
            asks_functions |= f.asks_function();
            has_body_forces |= f.acts_on_bodies;
        }, each);
}

}  // namespace pn
