// Which rows that should press must pull: where rows share a load that is no matter of one multiplier, for the shares are
// not unique, but of whether any sharing lets all of them press.
#pragma once

#include "constraints/redundancy.hpp"

namespace pn {

struct Press {
    double margin;             // largest normal force that all of them can have together; below zero some must pull
    std::vector<int> sharing;  // those that share a load with the row asked for, as indices of `pressing`
    std::vector<int> pulling;  // of them those that the margin hangs on together
    bool must_pull;            // by more than rounding
};

// Of one of the described rows `pressing`, whose multipliers should not be negative, for the shares of the multipliers
// in use, see `share_multipliers`.
Press press(const RowLayout& layout, const std::vector<Block>& blocks, const std::vector<double>& B,
            const DescribedRows& all, const std::vector<int>& pressing, RowSystem& s, const VecX& shared, int index);

}  // namespace pn
