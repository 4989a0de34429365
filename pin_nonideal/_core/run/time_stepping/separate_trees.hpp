// Contacts and dry friction of a time step on trees that no constraint joins, as a block problem.
#pragma once

#include "complementarity/blocks/solver.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

// Row k of a block, whose force is an unknown of the step.
struct StepRow {
    int block, k;
};

class SeparateTrees {
public:
    explicit SeparateTrees(const Program& p);

    // Set up the problem in a configured workspace, for the accelerations without forces and the offsets of the rows.
    // `rows` are those of the elements, one after the other. Returns false if it does not apply.
    bool pose(const Program& p, const Workspace& w, const std::vector<StepRow>& rows,
              const std::vector<ConeElement>& cones, const VecX& a_free, const VecX& offset);
    // Set other accelerations and offsets for the same rows.
    void release(const VecX& a_free, const VecX& offset);
    // Solve the laws for the forces f, from a guess. `middle` are forces around which the boxes are centered. Return the
    // largest error of an element, relative to its forces.
    double solve(const std::vector<ConeElement>& cones, const VecX& middle, VecX& f);
    // Compute the acceleration a and the rows w under the forces f.
    void move(const VecX& f, VecX& a, VecX& w);
    // Element that misses the laws most, and the velocity by which it misses them.
    const BlockSolver::Miss& miss() const { return solver_.miss(); }
    // Errors of the laws for the forces f.
    ConeResiduals residuals(const VecX& middle, const VecX& f);

private:
    bool applies(const Program& p, const Workspace& w) const;
    bool is_well_conditioned(const Workspace& w, int root) const;
    int node_of(const Program& p, const Workspace& w, int root);
    void shift(const VecX& middle);

    std::vector<int> root_, local_, size_;  // by dof: first dof of its tree, index in it; by first dof: dofs of the tree
    bool contiguous_ = true;                // the dofs of every tree follow one another
    std::vector<std::vector<int>> trees_;   // first dofs of the trees that a block moves
    std::vector<int> node_;                 // node of a tree by first dof, -1 if it takes no part
    BlockSolver solver_;
    VecX a_free_, f_;
};

}  // namespace pn
