// Program: the scene after its analysis, immutable and shared by threads.
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "constraints/redundancy.hpp"
#include "dynamics/failure.hpp"
#include "forces/friction.hpp"
#include "forces/given_forces.hpp"

namespace pn {

// A contact that may open: its gap is a row as long as it is closed.
struct Gap {
    int block = 0;
    double restitution = 0.0;
    std::vector<int> elements;  // of friction there
    int sliding = -1;           // of them the one along its plane, whose forces lie in Coulomb's cone
    int alike = -1;             // the first gap that measures the same, or itself
};

// What restitution e of a contact means in an impact: of rates of its gap, or of impulses.
enum class ImpactLaw { newton, poisson };

struct Program {
    // Defined in program.cpp: copies of all kinds of constraints, forces and laws take seconds to compile.
    Program();
    Program(const Program&);
    Program(Program&&) noexcept;
    Program& operator=(const Program&);
    Program& operator=(Program&&) noexcept;
    ~Program();

    Mechanism mechanism;
    std::vector<Block> blocks;  // constraints first, then gaps, then directions of friction
    int constraints = 0;        // number of blocks of constraints and contacts, gaps among them
    int first_gap = 0;          // block of the first gap
    std::vector<Gap> gaps;
    ImpactLaw impact_law = ImpactLaw::newton;
    std::vector<int> all_contacts;  // blocks of all contacts, in the order of their descriptions
    std::vector<int> contacts;  // blocks of contacts that are kept and of wheels, whose normal force should press
    std::vector<int> pressing;  // the rows of these forces, among those of all descriptions
    int user_rows = 0;          // rows of all constraint descriptions
    struct Copy { int row, first; double factor; };
    std::vector<Copy> copies;   // rows of descriptions that are not kept because they are multiples of others
    DescribedRows described;
    RowLayout layout;
    size_t entries = 0;         // of A and B

    std::vector<std::string> law_names;
    std::vector<Friction> frictions;
    std::vector<Law> laws;
    int user_laws = 0;
    int states = 0;  // of all laws

    std::vector<GivenForce> forces;
    Actuation actuation;
    VecX least_effort, most_effort;      // of the drives, by dof; empty where they give what is asked

    // What the scene does not need is not computed.
    bool has_laws() const { return !frictions.empty() || !laws.empty(); }
    bool limits_effort() const { return least_effort.size() > 0; }
    bool needs_reactions = false;        // some law reads them
    bool rubs_while_closed = false;      // no law acts but friction of contacts that may open
    bool driven = false;                 // forces or actuation
    bool has_body_forces = false;        // given forces that act on bodies
    bool moves_in_time = false;          // some constraint moves by itself
    bool driven_exactly = false;         // some does, and all rates are derivatives to rounding, not differences
    std::vector<double> breaks;          // times at which functions of time break, as they know them, ascending
    bool searches_breaks = false;        // some function of time is the user's and does not tell its breaks
    bool asks_functions = false;         // of the user's, for forces that may change while nothing moves
    bool affine_rates = true;            // the rate of every row is A(q, t) v + phi_t
    std::vector<int> constrained_joints;     // whose bodies the constraints tie, and all before them in the tree
    std::vector<Angle> constrained_angles;   // of these joints
    std::vector<int> constrained_dofs;       // in the supports of the rows, ascending

    // Of the implicit reaction equation at most: a limit for each element, a force for each of the user's laws.
    size_t unknowns() const { return frictions.size() + static_cast<size_t>(user_laws) * mechanism.nv; }
    // Rows of constraints and gaps come first, rows of friction's directions after them.
    int constraint_rows() const {
        return constraints < static_cast<int>(blocks.size()) ? blocks[constraints].row : layout.rows;
    }

    // The share of one row of a block's description in multipliers by kept row, see `share_multipliers`.
    double share(const Block& block, int row, const VecX& lam) const { return described.share(block.user_row + row, lam); }
    // Those of all rows of constraints and contacts, as users number them.
    VecX user_multipliers(const VecX& lam) const;

    // Whether a function of the user's measures a gap.
    bool is_users(int gap) const { return std::holds_alternative<UserGapRow>(blocks[gaps[gap].block].kind); }

    // A law, with places for its states.
    void add(Law law);
    // Numbers the kept rows, finds supports and lays out the storage; once, before the program is shared.
    void finish();
};

}  // namespace pn
