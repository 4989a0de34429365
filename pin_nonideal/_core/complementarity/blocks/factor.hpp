// Sparse factor of H = M + J^T G J for nodes that elements connect. The pattern of H is the graph of touching trees.
#pragma once

#include "complementarity/blocks/problem.hpp"

namespace pn {

// Island: nodes that elements connect, directly or through other nodes, and these elements.
struct Island {
    std::vector<int> nodes, elements;
};

// The islands of a problem. Nodes without elements belong to no island.
class Islands {
public:
    void find(const BlockProblem& p);
    int size() const { return size_; }
    const Island& operator[](int i) const { return islands_[i]; }

private:
    Island& of_node(int node);

    std::vector<Island> islands_;  // the first size_ islands, and unused storage
    std::vector<int> parent_, number_;
    int size_ = 0;
};

class BlockFactor {
public:
    // Choose an order of elimination with little fill, if the pattern differs from the last one.
    void analyse(const BlockProblem& p, const Island& island);
    // Factor H. G has nine numbers per element, row-major. Returns false if H is singular.
    bool factor(const BlockProblem& p, const Island& island, const std::vector<double>& G, bool symmetric);
    // x := H^-1 x on the nodes of the island.
    void solve(VecX& x) const;

private:
    struct Position {
        int node = 0, size = 0, first = 0;  // node, its unknowns and the first of them in x
        int diagonal = 0, exchanges = 0;    // entries in H_ and exchanges_
        std::vector<int> later;             // connected positions that are eliminated later, ascending
        std::vector<int> above, below;      // entries of the blocks (this, later) and (later, this)
    };

    void order(const BlockProblem& p, const Island& island);
    int& entry(int row, int column) { return entries_[row * static_cast<int>(positions_.size()) + column]; }
    int entry(int row, int column) const { return entries_[row * static_cast<int>(positions_.size()) + column]; }
    void assemble(const BlockProblem& p, const Island& island, const std::vector<double>& G);
    bool eliminate_symmetric();
    bool eliminate_general();

    std::vector<char> connected_;  // pairs of connected nodes of the island
    std::vector<int> links_, last_links_;  // nodes, and the two nodes of each element
    std::vector<int> pattern_, last_pattern_, place_, entries_, exchanges_;
    std::vector<Position> positions_;
    std::vector<double> H_, K_;
    size_t size_ = 0;
    bool symmetric_ = true;
};

}  // namespace pn
