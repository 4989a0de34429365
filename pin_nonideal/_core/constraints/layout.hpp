// Where the rows of all blocks stand in the symmetric matrix B B^T, and which of its entries are stored.
#pragma once

#include <utility>
#include <vector>

#include "constraints/block.hpp"

namespace pn {

// Rows stored so that row i of the symmetric matrix keeps columns first[i] .. i (an envelope): blocks that share no
// dof leave no entry, and the Cholesky factor stays inside.
struct RowLayout {
    int rows = 0;
    std::vector<int> position;  // of each kept row in elimination order
    std::vector<int> row_at;    // inverse of position
    std::vector<int> first, start;
    size_t entries = 0;
    using Common = std::vector<std::pair<int, int>>;  // where common dofs stand in two supports
    struct Pair {  // a block with another one with common dofs
        int other, common;
    };
    std::vector<Common> commons;  // of any two blocks with the same supports the same
    std::vector<Pair> pairs;      // those of each block after those of the one before
    std::vector<int> first_pair;  // of each block, and the end
};

RowLayout layout_rows(const std::vector<Block>& blocks, int nv);

}  // namespace pn
