// Responses of a time step's motion to a unit of each force of its elements, under the constraints.
#pragma once

#include <vector>

#include "dynamics/tree_blocks.hpp"
#include "dynamics/workspace.hpp"

namespace pn {

class StepResponses {
public:
    explicit StepResponses(const Program& p);

    void reset() { is_computed_ = false; }
    // Compute the responses of the rows in a configured workspace, unless they are known.
    void find(const Program& p, Workspace& w, const std::vector<StepRow>& rows);
    // Response of the first n rows to the forces of these rows. Rows that the constraints hold do not respond.
    auto matrix(int n) const { return W_.topLeftCorner(n, n); }
    double diagonal(int row) const { return W_(row, row); }
    // Add to `a` the acceleration due to the first n forces.
    void add_motion(const Program& p, Workspace& w, const VecX& f, int n, VecX& a);
    // Add to `lam` the multipliers of the constraints due to the first n forces.
    void add_multipliers(const VecX& f, int n, VecX& lam) const;

private:
    bool is_computed_ = false;
    bool scaled_ = true;  // response_ holds a_s = R^T a
    MatX W_, response_, multipliers_;
    VecX unit_, zero_, lam_, free_response_, force_, a_;
};

}  // namespace pn
