// Program: the scene after its analysis, immutable and shared by threads.
#pragma once

#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "constraints/row_layout.hpp"
#include "dynamics/failure.hpp"
#include "forces/friction.hpp"
#include "forces/given_forces.hpp"

namespace pn {

struct Program {
    Mechanism mechanism;
    std::vector<Block> blocks;  // constraints first, then directions of friction
    int constraints = 0;        // number of constraint blocks
    std::vector<int> contacts;  // blocks of contacts, whose multiplier should press
    int user_rows = 0;          // rows of all constraint descriptions
    RowLayout layout;
    size_t entries = 0;         // of A and B

    std::vector<std::string> law_names;
    std::vector<Friction> frictions;
    std::vector<Law> laws;
    int user_laws = 0;
    int states = 0;  // of all laws

    std::vector<GivenForce> forces;
    Actuation actuation;

    // What the scene does not need is not computed.
    bool has_laws() const { return !frictions.empty() || !laws.empty(); }
    bool needs_reactions = false;        // some law reads them
    bool driven = false;                 // forces or actuation
    bool has_body_forces = false;        // given forces that act on bodies
    bool moves_in_time = false;          // some constraint moves by itself
    bool asks_functions = false;         // of the user's, for forces that may change while nothing moves
    bool affine_rates = true;            // the rate of every row is A(q, t) v + phi_t
    std::vector<int> constrained_joints;     // whose bodies the constraints tie, and all before them in the tree
    std::vector<Angle> constrained_angles;   // of these joints
    std::vector<int> constrained_dofs;       // in the supports of the rows, ascending

    // Of the implicit reaction equation at most: a limit for each element, a force for each of the user's laws.
    size_t unknowns() const { return frictions.size() + static_cast<size_t>(user_laws) * mechanism.nv; }
    // Rows of constraints come first, rows of friction's directions after them.
    int constraint_rows() const {
        return constraints < static_cast<int>(blocks.size()) ? blocks[constraints].row : layout.rows;
    }

    // A law, with places for its states.
    void add(Law law);
    // Numbers the kept rows, finds supports and lays out the storage; once, before the program is shared.
    void finish();
};

}  // namespace pn
