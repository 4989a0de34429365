#include "dynamics/program.hpp"

#include <algorithm>

namespace pn {

// Numbers the law's states after those of the laws before.
template <class L>
static void number_states(Program& p, L& law) {
    if constexpr (std::is_same_v<L, UserLaw>) law.index = p.user_laws++;
    if constexpr (has_states<L>) law.state = p.states;
    p.states += law.states;
}

void Program::add(Law law) {
    std::visit([this](auto& kind) { number_states(*this, kind); }, law);
    laws.push_back(std::move(law));
}

void Program::finish() {
    int row = 0;
    entries = 0;
    for (Block& block : blocks) {
        block.row = row;
        row += static_cast<int>(block.kept.size());
        block.lay_out(mechanism);
        block.offset = static_cast<int>(entries);
        entries += block.support.size() * block.kept.size();
    }
    layout = layout_rows(blocks, mechanism.nv);
    std::vector<char> reached(mechanism.nv, 0);
    for (const Block& block : blocks)
        for (int dof : block.support) reached[dof] = 1;
    constrained_dofs.clear();
    for (int dof = 0; dof < mechanism.nv; ++dof)
        if (reached[dof]) constrained_dofs.push_back(dof);
    // A contact whose normal nothing moves along has no row: it carries nothing and never pulls.
    const auto bare = [&](int block) { return blocks[block].kept.empty(); };
    contacts.erase(std::remove_if(contacts.begin(), contacts.end(), bare), contacts.end());
    for (Friction& f : frictions) {
        if (f.load != Friction::Load::multiplier) continue;
        const Block& anchor = blocks[f.anchor];
        const auto kept = std::find(anchor.kept.begin(), anchor.kept.end(), f.anchor_row);
        f.row = anchor.row + static_cast<int>(kept - anchor.kept.begin());
        if (kept == anchor.kept.end()) f.load = Friction::Load::none;
    }
    for (const Friction& f : frictions) needs_reactions |= f.reaction != Reaction::none;
    // Kinds stand together, so that the order of their descriptions decides no sum.
    std::stable_sort(laws.begin(), laws.end(), [](const Law& a, const Law& b) { return a.index() < b.index(); });
    each_law<UserLaw>(laws, [&](const UserLaw& law) { needs_reactions |= law.reaction != Reaction::none; });
    for (int i = 0; i < constraints; ++i) {
        moves_in_time |= pn::moves_in_time(blocks[i].kind);
        affine_rates &= blocks[i].affine_rate;
    }
    std::vector<char> constrained(mechanism.joints.size(), 0);
    for (int i = 0; i < constraints; ++i)
        for (int joint : {blocks[i].joint1, blocks[i].joint2})
            for (; joint != 0; joint = mechanism.joints[joint].parent) constrained[joint] = 1;
    constrained_joints.clear();
    for (size_t joint = 1; joint < constrained.size(); ++joint)
        if (constrained[joint]) constrained_joints.push_back(static_cast<int>(joint));
    constrained_angles.clear();
    for (const Angle& angle : mechanism.angles)
        if (constrained[angle.joint]) constrained_angles.push_back(angle);
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
