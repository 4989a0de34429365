// Contacts and dry friction of a time step on trees that no constraint joins, as a block problem. Motions may be
// prescribed to joints.
#pragma once

#include "complementarity/blocks/solver.hpp"
#include "dynamics/tree_blocks.hpp"

namespace pn {

class SeparateTrees {
public:
    explicit SeparateTrees(const Program& p);

    // Set up the problem in a configured workspace, for the accelerations without forces and the offsets of the rows.
    // `rows`: rows of the elements, in sequence. Returns false if it does not apply.
    bool pose(const Program& p, const Workspace& w, const std::vector<StepRow>& rows,
              const std::vector<ConeElement>& cones, const VecX& a_free, const VecX& offset);
    // Set other accelerations and offsets for the same rows.
    void release(const VecX& a_free, const VecX& offset);
    // Solve the laws for the forces f, from a guess. The limits of an element without a cone bound its force about
    // `middle`. Return the largest error of an element, relative to its forces.
    double solve(const std::vector<ConeElement>& cones, const VecX& middle, VecX& f);
    // Change the forces f of the last call of `solve` if other forces hold the elements that rest, see BlockSolver::hold.
    // `rests`: per element. Return false if such elements cannot be held.
    bool hold(const std::vector<char>& rests, const VecX& middle, VecX& f);
    // Largest error of an element under the forces of `solve` and `hold`, relative to its forces.
    double error() const { return solver_.error(); }
    // Compute the acceleration a and the rows w under the forces f. `middle` as in `solve`.
    void move(const VecX& middle, const VecX& f, VecX& a, VecX& w);
    // Add the multipliers of the constraints due to the forces f of the rows, at the acceleration a under these forces.
    void add_multipliers(const Program& p, Workspace& w, const std::vector<StepRow>& rows, const VecX& f, const VecX& a,
                         VecX& lam);
    // Set the velocity v1 of trees to zero that were at rest, v0 = 0, and whose forces cancel over the step h.
    void keep_rest(double h, const VecX& v0, VecX& v1);
    // Element with the largest error of the laws, and this error as a velocity.
    const BlockSolver::Miss& miss() const { return solver_.miss(); }
    // Errors of the laws for the forces f.
    ConeResiduals residuals(const VecX& middle, const VecX& f);

private:
    bool applies(const Workspace& w) const;
    void exert(const VecX& middle, const VecX& f);
    void measure_balance();

    TreeBlocks blocks_;
    BlockSolver solver_;
    VecX a_free_, f_, middle_;
    VecX force_, rows_, change_, inertia_;  // in `add_multipliers`
    VecX f_moved_;           // forces of the last motion
    bool is_moved_ = false;  // the motion of f_moved_ is known
    std::vector<double> balanced_;  // per node: largest acceleration that forces cancel
};

}  // namespace pn
