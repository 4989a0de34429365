// Least moves dx in the metric of M that reduce residuals r of rows to zero, J dx = -r, island by island.
//
// The rows count with weights G far above their inertia: (M + J^T G J) dx = -J^T G r. Redundant rows need no choice.
// A move reduces the residual of a row by the ratio of its inertia to its weight, so two or three moves, with r evaluated
// between them, reach rounding error. Contradicting rows, and nearly contradicting ones, would need a long move. With lower
// weights they share the remaining residual.
#pragma once

#include "complementarity/blocks/factor.hpp"

namespace pn {

struct LeastMoveParameters {
    // Weight of a row, relative to the inertia that it moves, and the ratio of the next lower one.
    double max_weight = 1e8, weight_ratio = 1e-2;
    // A move longer than this many times the largest residual and the longest move of a single row resolves no gap: rows
    // contradict each other.
    double max_move_ratio = 5.0;
    // Largest fraction of a probing motion that remains at a node without freedom.
    double max_unheld_part = 1e-3;
};

class LeastMove {
public:
    using Parameters = LeastMoveParameters;
    static constexpr Parameters parameters{};

    // Nodes, elements, M and J are set by the caller before `pose`. Other rows need another `pose`: the weights would
    // amplify their difference. Moves exert equal and opposite forces on two nodes.
    BlockProblem problem;
    VecX lever;  // per unknown of the whole scene: length of a unit displacement, set by the caller

    // Prepare the problem once it is set. Return false if an inertia is not positive definite.
    bool pose();
    // Compute the move that reduces the residuals `r`, per unknown of the whole scene. Islands whose residuals are at most
    // `floor` do not move. Return false if no island moves.
    bool find(const VecX& r, double floor, VecX& move);
    // Check if the rows leave a node no freedom.
    bool is_immobile(int node);

private:
    bool factor(int island);
    double length(const BlockNode& node, const VecX& move) const;
    double longest_single(int island, const VecX& r);
    void exert(int island, const VecX& r, VecX& move);
    bool seek(int island, const VecX& r, VecX& move);
    void probe(int island);

    Islands islands_;
    std::vector<BlockFactor> factors_;    // one for each island
    std::vector<char> factored_, probed_;  // by island
    std::vector<int> island_of_;          // per node
    std::vector<char> immobile_;  // per node of a probed island
    std::vector<double> weight_;          // by island
    std::vector<Mat3> responses_;           // per element
    std::vector<double> own_response_, G_;  // own response of each row, and weights, nine numbers per element
    VecX probe_, scaled_, single_;
};

}  // namespace pn
