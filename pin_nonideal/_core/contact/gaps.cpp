#include "contact/gaps.hpp"

#include <cmath>

#include "constraints/redundancy.hpp"
#include "dynamics/reactions.hpp"

namespace pn {

// Part of the terms of a sum that rounding may leave of it.
constexpr double sum_rounding = 1e-12;

// The rate's own rate, and the size of its terms.
static std::pair<double, double> rate_of_rate(const Program& p, const Workspace& w, int gap) {
    const Block& block = p.blocks[p.gaps[gap].block];
    const double drift = w.now.values[p.gaps[gap].block].drift[block.kept[0]];
    double sum = drift, size = std::abs(drift);
    const double* A = w.now.A.data() + block.offset;
    for (size_t l = 0; l < block.support.size(); ++l) {
        const double term = A[l] * w.now.a[block.support[l]];
        sum += term;
        size += std::abs(term);
    }
    return {sum, size};
}

double gap_acceleration(const Program& p, const Workspace& w, int gap) { return rate_of_rate(p, w, gap).first; }

double acceleration_rounding(const Program& p, const Workspace& w, int gap) {
    return sum_rounding * (rate_of_rate(p, w, gap).second + p.mechanism.gravity.norm());
}

double load(const Program& p, Workspace& w, int gap) {
    return reactions(p, w).lam[p.blocks[p.gaps[gap].block].row];
}

double load_rounding(const Program& p, const Workspace& w, int gap) {
    const double scale = w.now.rows.scale[p.blocks[p.gaps[gap].block].row];  // square: mass that the row moves
    return sum_rounding * scale * scale * (w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm());
}

int pulling_contact(const Program& p, Workspace& w) {
    const Reactions& r = reactions(p, w);
    if (r.presses && w.now.rows.redundant) return -1;
    VecX lam = r.lam;
    if (w.now.rows.redundant) share_multipliers(p.layout, p.blocks, w.now.B, p.described, w.now.rows, w.now.lam, lam);
    int found = -1;
    double most = 0.0;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (!w.state.closed[i] || is_bare(p, i)) continue;
        const double pull = -lam[p.blocks[p.gaps[i].block].row] / load_rounding(p, w, i);
        if (!(pull > 1.0) || pull <= most) continue;
        most = pull;
        found = i;
    }
    return found;
}

}  // namespace pn
