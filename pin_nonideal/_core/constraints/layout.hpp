// Positions of the rows of all blocks in the symmetric matrix B B^T, and the stored entries of this matrix.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "constraints/block.hpp"

namespace pn {

// Envelope storage: row i of the symmetric matrix keeps columns first[i] .. i. Blocks without a common dof need no
// entries, and the Cholesky factor stays inside the envelope.
struct RowLayout {
    int rows = 0;
    std::vector<int> position;  // position of each kept row in elimination order
    std::vector<int> row_at;    // inverse of position
    std::vector<int> first;
    std::vector<std::ptrdiff_t> start;
    size_t entries = 0;
    using Common = std::vector<std::pair<int, int>>;  // positions of common dofs in two supports
    struct Pair {  // another block with common dofs
        int other, common;
    };
    std::vector<Common> commons;  // one list for all pairs of blocks with the same two supports
    std::vector<Pair> pairs;      // pairs of each block, in the order of the blocks
    std::vector<int> first_pair;  // first pair of each block, and the end
};

RowLayout layout_rows(const std::vector<Block>& blocks, int nv);

}  // namespace pn
