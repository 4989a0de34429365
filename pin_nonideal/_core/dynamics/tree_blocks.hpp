// Rows of contacts and dry friction as blocks of the trees that they move, if no constraint joins the trees.
#pragma once

#include "complementarity/blocks/problem.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

// Row k of a block, whose force is an unknown.
struct StepRow {
    int block, k;
};

class TreeBlocks {
public:
    explicit TreeBlocks(const Program& p);

    // Check if the dofs of every tree follow one another, and no tree is too deep for a matrix of its inertia.
    bool applies() const { return applies_; }
    // A dof of prescribed motion, and the block of this motion.
    struct Held {
        int block, dof;
    };
    // Hold the dofs of prescribed motions: forces of the rows do not move them. After this call `applies` is true only if
    // no other constraint acts.
    void hold_prescribed(const Program& p);
    const std::vector<Held>& held() const { return held_; }
    // Complete a displacement or a change of the velocity x, given on the held dofs and zero elsewhere, by the least change
    // of the other dofs of their trees in the metric of M. The workspace must hold M.
    void follow_held(const Program& p, const Workspace& w, VecX& x);
    // Add the part of the held dofs, in an acceleration or velocity x, to the rows of the last problem.
    void add_held(const VecX& x, VecX& rows) const;
    // Set the nodes, elements and blocks of a problem in a workspace with M and the rows A. `rows`: rows of the
    // elements, in sequence. Return false if an element moves more than two trees, if a row of a contact moves nothing but
    // held dofs, or if a tree is ill-conditioned.
    bool fill(const Program& p, const Workspace& w, const std::vector<StepRow>& rows,
              const std::vector<ConeElement>& cones, BlockProblem& problem);
    // Check if the velocity of a tree is not zero and at most `most`.
    bool has_slow_tree(const VecX& v, double most) const;

private:
    bool moves(const Block& block) const;
    void fill_inertia(const Program& p, const Workspace& w, int root, BlockMap M);
    void hold(int root, BlockMap M) const;
    bool is_well_conditioned(const Program& p, const Workspace& w, int root) const;
    int node_of(const Program& p, const Workspace& w, int root, BlockProblem& problem);

    std::vector<int> root_, local_, size_;  // per dof: first dof of its tree, index in it; per first dof: dofs of the tree
    bool applies_ = true;
    std::vector<Held> held_;
    std::vector<char> is_held_;             // per dof
    struct HeldEntry {
        int row, dof;
        double value;
    };
    std::vector<HeldEntry> held_entries_;   // entries of the last problem's rows on held dofs
    std::vector<int> node_;                 // node of a tree by first dof, -1 if it takes no part
    std::vector<ArticulatedInertia> composite_;
    std::vector<double> inertia_;           // of one tree
};

}  // namespace pn
