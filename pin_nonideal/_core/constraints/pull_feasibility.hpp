// Rows that must pull although their multipliers should not be negative. If rows share a load, single multipliers are
// not unique. A row must pull only if no distribution of the load has all rows in compression.
#pragma once

#include "constraints/redundancy.hpp"

namespace pn {

struct PullFeasibilityParameters {
    double binding = 1e-6;           // fraction of the largest weight below which a row does not bind
    double margin_rounding = 1e-12;  // rounding error of a margin, relative to the loads
};

inline constexpr PullFeasibilityParameters pull_feasibility_parameters{};

struct PullMargin {
    double margin;             // largest s with all multipliers >= s in some distribution (negative: some row must pull)
    std::vector<int> sharing;  // rows that share a load with the given row, as indices of `pressing`
    std::vector<int> pulling;  // rows among them that determine the margin together
    bool must_pull;            // the margin is negative by more than rounding
};

// Compute the margin of the described row pressing[index]. The multipliers of the rows `pressing` should not be
// negative. `shared` holds the result of `share_multipliers`.
PullMargin press(const std::vector<Block>& blocks, const RowEntries& B,
            const DescribedRows& all, const std::vector<int>& pressing, RowSystem& s, const VecX& shared, int index);

}  // namespace pn
