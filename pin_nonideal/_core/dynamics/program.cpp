#include "dynamics/program.hpp"

#include <algorithm>
#include <numeric>
#include <map>
#include <unordered_map>

namespace pn {

Program::Program() = default;
Program::Program(const Program&) = default;
Program::Program(Program&&) noexcept = default;
Program& Program::operator=(const Program&) = default;
Program& Program::operator=(Program&&) noexcept = default;
Program::~Program() = default;

// Number the law's states after those of the previous laws.
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

// Map rows of descriptions to kept rows.
static void number_descriptions(Program& p) {
    int next = p.user_rows;
    for (size_t i = p.constraints; i < p.blocks.size(); ++i) {
        p.blocks[i].user_row = next;
        next += p.blocks[i].total;
    }
    p.described = {};
    std::vector<DescribedRows::Row>& rows = p.described.rows;
    rows.resize(next);
    for (const Block& block : p.blocks)
        for (size_t k = 0; k < block.kept.size(); ++k)
            rows[block.user_row + block.kept[k]].kept = block.row + static_cast<int>(k);
    for (const Program::Copy& copy : p.copies) {
        rows[copy.row].kept = rows[copy.first].kept;
        rows[copy.row].factor = copy.factor;
    }
    p.described.finish(p.layout.rows);
}

// Geometry of a gap as a list of numbers.
class GapNumbers {
public:
    // Return the bytes of the numbers, none for kinds with other data, such as solids or functions.
    std::string bytes(const Program& p, const Gap& gap) {
        numbers_.clear();
        is_known_ = true;
        const Kind& kind = p.blocks[gap.block].kind;
        add(static_cast<double>(kind.index()));
        std::visit([this](const auto& k) {
            std::apply([&](const auto&... data) { (add(k.*data.member), ...); }, k.data());
        }, kind);
        return {reinterpret_cast<const char*>(numbers_.data()), is_known_ ? numbers_.size() * sizeof(double) : 0};
    }

private:
    void add(double x) { numbers_.push_back(x + 0.0); }  // -0 and 0 have different bytes
    void add(int x) { numbers_.push_back(x); }
    void add(const Vec3& x) {
        for (int k = 0; k < 3; ++k) add(x[k]);
    }
    void add(const SharedFrame& x) {
        add(x->joint);
        for (int k = 0; k < 3; ++k) add(x->R.col(k));
        add(x->p);
    }
    template <class Other>
    void add(const Other&) { is_known_ = false; }

    std::vector<double> numbers_;
    bool is_known_ = true;
};

static void number_bodies(Program& p) {
    std::map<std::pair<int, int>, int> numbers;
    p.bodies_of_gap.clear();
    for (const Gap& gap : p.gaps) {
        const std::pair<int, int> bodies = std::minmax({p.blocks[gap.block].joint1, p.blocks[gap.block].joint2});
        p.bodies_of_gap.push_back(numbers.emplace(bodies, static_cast<int>(numbers.size())).first->second);
    }
}

static void find_duplicates(Program& p) {
    std::unordered_map<std::string, int> first;
    GapNumbers numbers;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        std::string bytes = numbers.bytes(p, p.gaps[i]);
        p.gaps[i].same_geometry_as = bytes.empty() ? i : first.emplace(std::move(bytes), i).first->second;
    }
}

VecX Program::user_multipliers(const VecX& lam) const {
    VecX all(user_rows);
    for (int row = 0; row < user_rows; ++row) all[row] = described.share(row, lam);
    return all;
}

// Return the dofs along which rows of a block may act: the dofs between its bodies, or of its coordinates.
static std::vector<int> acting_dofs(const Program& p, const Block& block) {
    if (block.kept.empty()) return {};
    if (!frames(block.kind).first) return dofs(block.kind, p.mechanism);
    std::vector<int> acting;
    for (const DofSupport::Entry& entry : block.entries()) acting.push_back(entry.dof);
    return acting;
}

// Find the dofs that constraints tie to a constraint that depends on time, and the friction elements along such dofs.
// Blocks without rows tie no dofs.
static void find_tied_to_drives(Program& p) {
    p.tied_to_drives.assign(p.mechanism.nv, 0);
    p.elements_of_drives.assign(p.frictions.size(), 0);
    if (!p.moves_in_time) return;
    std::vector<int> parent(p.mechanism.nv);
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int dof) {
        while (parent[dof] != dof) dof = parent[dof] = parent[parent[dof]];
        return dof;
    };
    std::vector<int> timed;  // a dof of each constraint that depends on time
    for (int i = 0; i < p.constraints; ++i) {
        const std::vector<int> acting = acting_dofs(p, p.blocks[i]);
        for (int dof : acting) parent[root(dof)] = root(acting[0]);
        if (!acting.empty() && pn::moves_in_time(p.blocks[i].kind)) timed.push_back(acting[0]);
    }
    std::vector<char> drives(p.mechanism.nv, 0);
    for (int dof : timed) drives[root(dof)] = 1;
    for (int dof = 0; dof < p.mechanism.nv; ++dof) p.tied_to_drives[dof] = drives[root(dof)];
    for (size_t e = 0; e < p.frictions.size(); ++e) {
        const std::vector<int> acting = acting_dofs(p, p.blocks[p.frictions[e].block]);
        p.elements_of_drives[e] =
            std::any_of(acting.begin(), acting.end(), [&](int dof) { return p.tied_to_drives[dof]; });
    }
}

// Check if each element that reads the reaction to its own force acts on dofs of the tree joint whose load it bears.
static bool loads_are_of_trees(const Program& p) {
    if (p.mechanism.provider != Provider::core) return false;
    for (const Friction& f : p.frictions) {
        if (f.reaction != Reaction::total) continue;
        const int dof = p.blocks[f.block].dof;
        if (f.load == Friction::Load::user || f.joint <= 0 || dof < 0 || p.mechanism.dof_joint[dof] != f.joint) return false;
    }
    bool reads = false;
    bool pushes_bodies = std::any_of(p.frictions.begin(), p.frictions.end(),
                                     [&](const Friction& f) { return p.blocks[f.block].dof < 0; });
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) { reads |= law.reaction == Reaction::total; });
    each_law<Drag>(p.laws, [&](const Drag&) { pushes_bodies = true; });
    each_law<Viscous>(p.laws, [&](const Viscous& law) { pushes_bodies |= law.block >= 0 && p.blocks[law.block].dof < 0; });
    return !reads && (p.mechanism.deep_dofs.empty() || !pushes_bodies);
}

void Program::finish() {
    int row = 0;
    entries = 0;
    SharedSupports supports;
    for (Block& block : blocks) {
        block.row = row;
        row += static_cast<int>(block.kept.size());
        block.lay_out(mechanism, supports);
        block.offset = static_cast<int>(entries);
        entries += block.support().size() * block.kept.size();
    }
    layout = layout_rows(blocks, mechanism.nv);
    std::vector<char> reached(mechanism.nv, 0);
    for (const Block& block : blocks)
        for (int dof : block.support()) reached[dof] = 1;
    constrained_dofs.clear();
    for (int dof = 0; dof < mechanism.nv; ++dof)
        if (reached[dof]) constrained_dofs.push_back(dof);
    number_descriptions(*this);
    // A contact without mobility along its normal has no load and never opens.
    const auto normal = [&](int block) { return blocks[block].user_row + pressing_row(blocks[block].kind); };
    const auto bare = [&](int block) { return described.rows[normal(block)].kept < 0; };
    contacts.clear();
    for (int i = 0; i < first_gap; ++i)
        if (pressing_row(blocks[i].kind) >= 0 && !bare(i)) contacts.push_back(i);
    pressing.resize(contacts.size());
    std::transform(contacts.begin(), contacts.end(), pressing.begin(), normal);
    for (Gap& gap : gaps) {
        gap.elements.clear();
        gap.sliding = -1;
    }
    for (size_t e = 0; e < frictions.size(); ++e) {
        Friction& f = frictions[e];
        f.gap = f.anchor >= first_gap ? f.anchor - first_gap : -1;
        if (f.load != Friction::Load::multiplier) described.yield(blocks[f.block]);
        if (f.gap < 0) continue;
        gaps[f.gap].elements.push_back(static_cast<int>(e));
        // Spinning and rolling resistance have their own row kind.
        if (!std::holds_alternative<SpinSlipRows>(blocks[f.block].kind)) gaps[f.gap].sliding = static_cast<int>(e);
    }
    number_bodies(*this);
    find_duplicates(*this);
    for (Friction& f : frictions) {
        if (f.load != Friction::Load::multiplier) continue;
        f.row = blocks[f.anchor].user_row + f.anchor_row;
        if (described.rows[f.row].kept < 0) f.load = Friction::Load::none;
    }
    elements_without_reaction.clear();
    elements_of_ideal_loads.clear();
    for (int e = 0; e < static_cast<int>(frictions.size()); ++e) {
        const Reaction reaction = frictions[e].reaction;
        needs_reactions |= reaction != Reaction::none;
        if (reaction == Reaction::none) elements_without_reaction.push_back(e);
        if (reaction == Reaction::ideal) elements_of_ideal_loads.push_back(e);
    }
    has_contact_friction_only = laws.empty() && std::all_of(frictions.begin(), frictions.end(),
                                                    [](const Friction& f) { return f.gap >= 0; });
    // Group laws by kind, so that the order of their descriptions does not affect rounding.
    std::stable_sort(laws.begin(), laws.end(), [](const Law& a, const Law& b) { return a.index() < b.index(); });
    each_law<UserLaw>(laws, [&](const UserLaw& law) { needs_reactions |= law.reaction != Reaction::none; });
    loads_are_of_trees = pn::loads_are_of_trees(*this);
    bool by_differences = false;
    for (int i = 0; i < constraints; ++i) {
        moves_in_time |= pn::moves_in_time(blocks[i].kind);
        by_differences |= std::holds_alternative<UserGapRow>(blocks[i].kind);
        affine_rates &= blocks[i].affine_rate;
        for (const TimeFunction* f : time_functions(blocks[i].kind)) {
            const std::vector<double> known = pn::breaks(*f);
            breaks.insert(breaks.end(), known.begin(), known.end());
            searches_breaks |= pn::is_users(*f);
        }
    }
    find_tied_to_drives(*this);
    driven_exactly = moves_in_time && !by_differences;
    has_user_rows = by_differences || !affine_rates;
    std::sort(breaks.begin(), breaks.end());
    breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
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
    calls_functions = std::holds_alternative<TorqueFunction>(actuation) || user_laws > 0;
    for (const Friction& f : frictions) calls_functions |= f.user_limit != nullptr;
    for (const GivenForce& each : forces)
        std::visit([&](const auto& f) {
            calls_functions |= f.calls_function();
            has_body_forces |= f.acts_on_bodies;
        }, each);
}

}  // namespace pn
