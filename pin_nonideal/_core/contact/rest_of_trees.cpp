#include "contact/rest_of_trees.hpp"

#include <algorithm>

#include "complementarity/blocks/solver.hpp"
#include "dynamics/tree_blocks.hpp"
#include "math/tolerances.hpp"

namespace pn {

bool rest_on_trees(const Program& p, Workspace& w, const std::vector<int>& gaps, const std::vector<int>& others,
                   const std::vector<ConeElement>& cones) {
    TreeBlocks blocks(p);
    const std::vector<char>& locked = w.now.terms.locked;
    const bool separate = w.now.rows.blocks.empty() && std::find(locked.begin(), locked.end(), char(1)) == locked.end();
    if (!separate || !blocks.applies()) return false;
    std::vector<StepRow> rows;
    for (size_t i = 0; i < cones.size(); ++i) {
        int k = 0;
        if (i < gaps.size()) rows.push_back({p.gaps[gaps[i]].block, k++});
        const int e = i < gaps.size() ? p.gaps[gaps[i]].sliding : others[i - gaps.size()];
        for (int direction = 0; k < cones[i].dim; ++k, ++direction) rows.push_back({p.frictions[e].block, direction});
    }
    BlockSolver solver;
    if (!blocks.fill(p, w, rows, cones, solver.problem)) return false;
    solver.problem.offset = VecX::Zero(solver.problem.rows);
    if (!solver.pose()) return false;
    VecX f = solver.problem.offset, x = w.now.a;
    solver.release(w.now.a, f);
    if (!(solver.solve(f) <= rest_of_trees_parameters.tolerance)) return false;
    solver.motion(x);
    double rest = 0.0, moves = 0.0, weight = 0.0;
    for (const BlockNode& node : solver.problem.nodes) {
        const auto a = w.now.a.segment(node.first, node.size);
        rest = std::max(rest, a.cwiseAbs().maxCoeff());
        moves = std::max(moves, x.segment(node.first, node.size).cwiseAbs().maxCoeff());
        const ConstBlockMap M(solver.problem.M.data() + node.M, node.size, node.size);
        for (int i = 0; i < node.size; ++i) {
            double sum = 0.0;
            for (int k = 0; k < node.size; ++k) sum += M(i, k) * a[k];
            weight += std::abs(sum);
        }
    }
    return moves <= tree_acceleration_rounding * rest &&
           f.cwiseAbs().maxCoeff() <= rest_of_trees_parameters.max_force_ratio * weight;
}

}  // namespace pn
