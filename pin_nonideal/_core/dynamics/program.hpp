// Program: the scene after its analysis, immutable and shared by threads.
#pragma once

#include <algorithm>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "constraints/redundancy.hpp"
#include "dynamics/failure.hpp"
#include "forces/friction.hpp"
#include "forces/given_forces.hpp"

namespace pn {

// Unilateral contact: its gap is a row while the contact is closed.
struct Gap {
    int block = 0;
    double restitution = 0.0;
    std::vector<int> elements;  // friction elements of the contact
    int sliding = -1;           // sliding element along the contact plane, with forces in Coulomb's cone
    int same_geometry_as = -1;  // first gap with the same geometry, or the gap itself
    int pair = -1;              // pair of convex shapes that the gap is part of, -1 if none
};

// Meaning of the restitution e of a contact in an impact: ratio of gap rates (Newton) or of impulses (Poisson).
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
    int constraints = 0;        // number of blocks of constraints and contacts, including gaps
    int first_gap = 0;          // block of the first gap
    std::vector<Gap> gaps;
    std::vector<int> bodies_of_gap;  // number of the pair of bodies of each gap
    ImpactLaw impact_law = ImpactLaw::newton;
    std::vector<int> all_contacts;  // blocks of all contacts, in the order of their descriptions
    std::vector<int> contacts;  // blocks of kept bilateral contacts and of wheels, which need a compressive normal force
    std::vector<int> pressing;  // described rows of these forces
    int user_rows = 0;          // rows of all constraint descriptions
    struct Copy { int row, first; double factor; };
    std::vector<Copy> copies;   // described rows that are multiples of other rows and not kept
    DescribedRows described;
    RowLayout layout;
    size_t entries = 0;         // number of entries of A and B

    std::vector<std::string> law_names;
    std::vector<Friction> frictions;
    std::vector<int> elements_without_reaction, elements_of_ideal_loads;  // friction elements by their reaction
    std::vector<Law> laws;
    int user_laws = 0;
    int states = 0;  // number of states of all laws

    std::vector<GivenForce> forces;
    Actuation actuation;
    TorqueTable added_torque;     // torques in addition to a sampled control; no times if there are none
    VecX min_effort, max_effort;  // limits of the actuators, per dof (empty if unlimited)

    // Flags that skip computations that the scene does not need.
    bool has_laws() const { return !frictions.empty() || !laws.empty(); }
    bool limits_effort() const { return min_effort.size() > 0; }
    // Return the actuation torques that are linear between times, null if there are none.
    const TorqueTable* torque_table() const {
        return added_torque.times.empty() ? std::get_if<TorqueTable>(&actuation) : &added_torque;
    }
    bool needs_reactions = false;        // some law reads reactions
    bool loads_are_of_trees = false;     // all friction that reads its own reaction acts in the tree joint that it loads
    bool has_contact_friction_only = false;      // the only law is friction of unilateral contacts
    bool driven = false;           // the scene has forces or actuation
    bool has_body_forces = false;  // given forces that act on bodies
    bool moves_in_time = false;    // some constraint depends on time
    // Per dof: constraints tie it to a constraint that depends on time, which may carry loads of friction on this dof.
    std::vector<char> tied_to_drives;
    std::vector<char> elements_of_drives;  // per friction element: its slip is along such a dof
    // Check if a drive may decide the slip of an element.
    bool follows_drives(int element) const { return elements_of_drives[element]; }
    bool driven_exactly = false;   // some constraint depends on time, and all rates are exact derivatives, not differences
    std::vector<double> breaks;    // known break times of the functions of time, ascending
    bool searches_breaks = false;  // some user function of time does not declare its breaks
    bool calls_functions = false;  // the forces depend on user functions
    // Check if forces may change while nothing moves.
    bool changes_at_rest() const { return calls_functions || moves_in_time; }
    bool has_user_rows = false;    // some rows come from user functions, A and b together
    bool affine_rates = true;      // the rate of every row is A(q, t) v + phi_t
    std::vector<int> constrained_joints;     // joints whose bodies the constraints tie, and their ancestors in the tree
    std::vector<Angle> constrained_angles;   // angles of the constrained joints
    std::vector<int> constrained_dofs;       // in the supports of the rows, ascending

    // Maximum size of the implicit reaction equation: a limit for each element, a force for each user law.
    size_t unknowns() const { return frictions.size() + static_cast<size_t>(user_laws) * mechanism.nv; }
    // Number of rows of constraints and gaps. Rows of friction directions follow the rows of constraints and contacts.
    int constraint_rows() const {
        return constraints < static_cast<int>(blocks.size()) ? blocks[constraints].row : layout.rows;
    }

    // Number of rows of constraints and bilateral contacts, which precede the rows of gaps.
    int bilateral_rows() const { return gaps.empty() ? constraint_rows() : blocks[first_gap].row; }

    // Multiplier of one row of a block's description for multipliers per kept row, see `share_multipliers`.
    double share(const Block& block, int row, const VecX& lam) const { return described.share(block.user_row + row, lam); }
    // Multipliers of all rows of constraints and contacts in the user's numbering.
    VecX user_multipliers(const VecX& lam) const;

    // Check if a user function measures a gap.
    bool is_users(int gap) const { return std::holds_alternative<UserGapRow>(blocks[gaps[gap].block].kind); }

    // Add a law and allocate its states.
    void add(Law law);
    // Number the kept rows, compute supports and lay out the storage. Call once, before threads share the program.
    void finish();
};

}  // namespace pn
