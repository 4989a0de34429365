#include "dynamics/reported_loads.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/blocks/solver.hpp"
#include "constraints/redundancy.hpp"
#include "dynamics/tree_blocks.hpp"
#include "math/decompositions.hpp"

namespace pn {

namespace {

// Rows of the sticking contacts as a cone problem. The w of this problem is zero for all multipliers that exert the same
// force as the current multipliers.
struct StickingShares {
    std::vector<int> rows;
    std::vector<StepRow> of_blocks;  // the same rows
    std::vector<ConeElement> cones;
    bool outside = false;  // a contact pulls, or its friction is beyond its limit
    bool known = true;     // a friction element other than a contact shares the load
    bool joined = false;   // constraints share the load

    StickingShares(const Program& p, const Workspace& w, const VecX& lam, const FreeMultipliers& free) {
        std::vector<char> taken(p.layout.rows, 0);
        for (size_t i = 0; i < p.gaps.size(); ++i) {
            const Block& normal = p.blocks[p.gaps[i].block];
            if (!w.state.closed[i] || normal.kept.empty()) continue;
            add_contact(p, w, lam, p.gaps[i], taken);
        }
        for (int row : free.rows()) {
            if (taken[row] || !(free.norm_of_row(row) > reported_loads_parameters.min_part)) continue;
            known &= row < p.constraint_rows();
            rows.push_back(row);
            cones.push_back({ConeElement::Kind::equality, 1, 0.0});
            joined = true;
        }
    }

    void add_contact(const Program& p, const Workspace& w, const VecX& lam, const Gap& gap, std::vector<char>& taken) {
        const int e = gap.sliding;
        const bool sticks = e >= 0 && w.state.mode[e] == sticking;
        const int dim = sticks ? static_cast<int>(p.blocks[p.frictions[e].block].kept.size()) : 0;
        const double mu = sticks ? p.frictions[e].holding_limit(p.frictions[e].mu) : 0.0;
        rows.push_back(p.blocks[gap.block].row);
        of_blocks.push_back({gap.block, 0});
        for (int k = 0; k < dim; ++k) {
            rows.push_back(p.blocks[p.frictions[e].block].row + k);
            of_blocks.push_back({p.frictions[e].block, k});
        }
        for (int k = 0; k <= dim; ++k) taken[rows[rows.size() - 1 - k]] = 1;
        cones.push_back(ConeElement::contact(1 + dim, mu));
        double friction = 0.0;
        for (int k = 0; k < dim; ++k) friction = std::hypot(friction, lam[rows[rows.size() - 1 - k]]);
        const double load = lam[p.blocks[gap.block].row];
        outside |= load < 0.0 || friction > mu * load * (1.0 + reported_loads_parameters.cone_rounding);
    }
};

bool all_stick(const Program& p, const Workspace& w) {
    bool stick = w.state.sticks_anywhere();
    for (size_t e = 0; e < p.frictions.size(); ++e)
        stick &= !slips(w.state.mode[e]) || p.frictions[e].mu == 0.0;
    return stick;
}

// Find forces f within the cones that exert the same forces on each tree as the forces `of_rows`. Contacts share the
// loads as equally compliant ones do.
bool share_tree_by_tree(const Program& p, const Workspace& w, const StickingShares& shares, const VecX& of_rows,
                        VecX& f) {
    TreeBlocks trees(p);
    BlockSolver solver;
    const bool fits = trees.applies() && trees.fill(p, w, shares.of_blocks, shares.cones, solver.problem);
    if (!fits || !solver.pose()) return false;
    solver.problem.offset.setZero(solver.problem.rows);
    solver.release(VecX::Zero(p.mechanism.nv), -of_rows);
    f.setZero();
    solver.move(f);
    return solver.hold(f);
}

// Find the shortest forces f within the cones that exert the same force as the forces `of_rows`.
bool share_shortest(const StickingShares& shares, const FreeMultipliers& free, const VecX& of_rows, VecX& f) {
    const int n = static_cast<int>(shares.rows.size());
    MatX Z(n, free.count());
    for (int k = 0; k < n; ++k) Z.row(k) = free.of_row(shares.rows[k]).transpose();
    const MatX S = Z.transpose() * Z;
    Cholesky factor;
    factor.compute(S);
    const MatX Q = factor.solve_lower(Z.transpose()).transpose();
    const MatX W = MatX::Identity(n, n) - Q * Q.transpose();  // zero for multipliers that exert no force
    return ConeComplementarity().hold(W, -W * of_rows, shares.cones, f);
}

}  // namespace

ReportedLoads::ReportedLoads(const Program& p, Workspace& w) : w_(w) {
    if (p.gaps.empty() || !w.now.rows.redundant || !all_stick(p, w)) return;
    const VecX lam = reactions(p, w).lam;
    const FreeMultipliers free = free_multipliers(p.blocks, w.now.B, p.described, w.now.rows);
    const StickingShares shares(p, w, lam, free);
    const std::vector<char>& locked = w.now.terms.locked;
    const bool is_free = std::find(locked.begin(), locked.end(), char(1)) == locked.end();
    in_cones_ = shares.known && !shares.outside && is_free;
    if (!shares.known) return;
    const int n = static_cast<int>(shares.rows.size());
    VecX of_rows(n), f(n);
    for (int k = 0; k < n; ++k) of_rows[k] = lam[shares.rows[k]];
    // Many contacts share loads in one way, whether the minimum-norm multipliers happen to be within the cones or not.
    const bool tree_by_tree = n > reported_loads_parameters.max_rows && !shares.joined && is_free;
    if (!(tree_by_tree && share_tree_by_tree(p, w, shares, of_rows, f)) &&
        !(shares.outside && share_shortest(shares, free, of_rows, f)))
        return;
    minimum_norm_ = lam;
    Reactions& r = w.now.reactions;
    for (int k = 0; k < n; ++k) r.lam[shares.rows[k]] = f[k];
    r.swept = false;
    in_cones_ = is_free;
}

ReportedLoads::~ReportedLoads() {
    if (minimum_norm_.size() == 0) return;
    w_.now.reactions.lam = minimum_norm_;
    w_.now.reactions.swept = false;
}

}  // namespace pn
