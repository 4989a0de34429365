// Order in which the rows of blocks are eliminated in the symmetric matrix B B^T, and the entries that they need.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "constraints/block.hpp"

namespace pn {

// Order of all blocks, and the dofs that they share. Blocks with the same support are treated alike.
struct RowLayout {
    int rows = 0;
    std::vector<int> place;      // position of each block in the order of elimination
    std::vector<int> support;    // number of each block's support
    using Common = std::vector<std::pair<int, int>>;  // positions of common dofs in two supports
    struct Neighbor {  // support with common dofs
        int support, common;
    };
    std::vector<std::vector<Neighbor>> neighbors;  // of each support, itself included
    std::vector<Common> commons;                   // one list for each two supports
};

RowLayout layout_rows(const std::vector<Block>& blocks, int nv);

// Envelope storage of B B^T for the rows in use: row i of the symmetric matrix keeps columns first[i] .. i. Blocks
// without a common dof need no entries, and the Cholesky factor stays inside the envelope.
class Envelope {
public:
    struct Pair {  // block and an earlier one, or itself, with common dofs
        int block, other, common;
    };
    std::vector<int> position;  // position of each kept row in use
    std::vector<int> row_at;    // kept rows in the order of elimination
    std::vector<int> first;     // by position
    std::vector<std::ptrdiff_t> start;
    std::vector<Pair> pairs;
    size_t entries = 0;

    int size() const { return static_cast<int>(row_at.size()); }
    // Set up the envelope of the rows of some blocks.
    void select(const RowLayout& layout, const std::vector<Block>& all, const std::vector<int>& used);

private:
    std::vector<int> order_;
    std::vector<std::vector<int>> of_support_;  // blocks with the same support that have a place
};

}  // namespace pn
