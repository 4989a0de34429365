#include "dynamics/constraint_gaps.hpp"

#include <algorithm>
#include <cmath>

#include "math/tolerances.hpp"

namespace pn {

double scene_size(const Program& p, const Workspace& w) {
    double square = 1.0;
    for (int i : p.constrained_joints) {
        const Body& body = w.now.terms.body[i];
        square = std::max(square, (body.ref + body.p).squaredNorm());
    }
    return std::sqrt(square);
}

// Largest entry of a row of A, at least 1. Scaling a row up scales its gap by the same factor.
static double row_size(const Workspace& w, const Block& block, int row) {
    double size = 1.0;
    const size_t n = block.kept.size();
    for (size_t k = 0; k < n; ++k) {
        if (block.kept[k] != row) continue;
        for (size_t l = 0; l < block.support().size(); ++l)
            size = std::max(size, std::abs(w.now.A[block.offset + l * n + k]));
    }
    return size;
}

double opening(const Program& p, const Workspace& w, int block, double allowed) {
    double largest = 0.0;
    for (int k = 0; k < w.now.values[block].rows; ++k) {
        const double gap = std::abs(w.now.values[block].residual[k]);
        if (gap <= allowed || gap <= allowed * row_size(w, p.blocks[block], k) || gap < largest) continue;
        largest = gap;
    }
    return largest;
}

void require_closed(const Program& p, const Workspace& w, double t) {
    const double allowed = max_projected_gap * scene_size(p, w);
    double largest = 0.0;
    int worst = -1;
    for (int i : w.now.active_blocks) {
        const double gap = i < p.constraints ? opening(p, w, i, allowed) : 0.0;
        if (gap == 0.0 || gap < largest) continue;
        largest = gap;
        worst = i;
    }
    if (worst >= 0) throw Failure(Failure::Kind::closure, t, {worst}, largest);
}

double closing_distance(const Program& p, Workspace& w) {
    w.scratch.scaled.setZero();
    for (int i : w.now.rows.blocks) add_transpose(p.blocks[i], w.now.B, w.now.closing_lam, w.scratch.scaled);
    return w.scratch.scaled.norm();
}

}  // namespace pn
