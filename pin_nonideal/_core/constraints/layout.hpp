// Order in which the rows of blocks are eliminated in the symmetric matrix B B^T, and the entries that they need.
#pragma once

#include <cstddef>
#include <map>
#include <utility>
#include <vector>

#include "constraints/block.hpp"

namespace pn {

// Positions of common dofs in two supports.
using CommonDofs = std::vector<std::pair<int, int>>;

// Order of all blocks, and the dofs that they share. Blocks with the same support are treated alike. Dofs that belong to
// the same supports, such as those of a free body, form a group.
struct RowLayout {
    int rows = 0;
    int group_count = 0;
    std::vector<int> place;                // position of each block in the order of elimination
    std::vector<int> support;              // number of each block's support
    std::vector<std::vector<int>> groups;  // of each support. Supports with a common group have common dofs
};

RowLayout layout_rows(const std::vector<Block>& blocks, int nv);

// Envelope storage of B B^T for the rows in use: row i of the symmetric matrix keeps columns first[i] .. i. Blocks
// without a common dof need no entries, and the Cholesky factor stays inside the envelope.
class Envelope {
public:
    struct Pair {  // block and an earlier one, or itself, with common dofs
        int block, other, common;  // common: index for common()
    };
    std::vector<int> position;  // position of each kept row in use
    std::vector<int> row_at;    // kept rows in the order of elimination
    std::vector<int> first;     // by position
    std::vector<std::ptrdiff_t> start;
    std::vector<Pair> pairs;
    size_t entries = 0;

    int size() const { return static_cast<int>(row_at.size()); }
    const CommonDofs& common(int i) const { return commons_[i]; }
    // Set up the envelope of the rows of some blocks.
    void select(const RowLayout& layout, const std::vector<Block>& all, const std::vector<int>& used);

private:
    int find_common(const Block& one, int support, const Block& other, int other_support);

    std::vector<int> order_;
    std::vector<std::vector<int>> of_support_;  // blocks with the same support that have a place
    std::vector<std::vector<int>> of_group_;    // supports of these blocks, by group of dofs
    std::vector<int> visitor_;                  // per support: last block paired with it
    std::vector<CommonDofs> commons_;           // common dofs of supports that were in use together
    std::map<std::pair<int, int>, int> common_of_;
};

}  // namespace pn
