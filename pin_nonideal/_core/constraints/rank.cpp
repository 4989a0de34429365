#include "constraints/rank.hpp"

#include "constraints/orthogonal.hpp"

namespace pn {

void decide_rows(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
                 RowSystem& s, double tolerance) {
    delassus(layout, blocks, B, s);
    scale_to_unit_length(layout, s.required, s);
    find_independent(blocks, B, tolerance, s);
}

}  // namespace pn
