#include "run/time_stepping/separate_trees.hpp"

#include <algorithm>

#include "math/tolerances.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

SeparateTrees::SeparateTrees(const Program& p) : blocks_(p) { blocks_.hold_prescribed(p); }

// Check if the scene can be solved tree by tree now: no dof is locked, and the inertia of every tree is a matrix.
bool SeparateTrees::applies(const Workspace& w) const {
    const std::vector<char>& locked = w.now.terms.locked;
    return blocks_.applies() && std::find(locked.begin(), locked.end(), char(1)) == locked.end();
}

bool SeparateTrees::pose(const Program& p, const Workspace& w, const std::vector<StepRow>& rows,
                         const std::vector<ConeElement>& cones, const VecX& a_free, const VecX& offset) {
    BlockProblem& problem = solver_.problem;
    if (!applies(w) || !blocks_.fill(p, w, rows, cones, problem)) return false;
    f_.setZero(problem.rows);
    release(a_free, offset);
    return solver_.pose();
}

void SeparateTrees::release(const VecX& a_free, const VecX& offset) {
    a_free_ = a_free;
    solver_.problem.offset = offset.head(solver_.problem.rows);
    blocks_.add_held(a_free, solver_.problem.offset);
    is_moved_ = false;
}

double SeparateTrees::solve(const std::vector<ConeElement>& cones, const VecX& middle, VecX& f) {
    const int n = solver_.problem.rows;
    for (size_t e = 0; e < cones.size(); ++e) solver_.problem.elements[e].cone.bound = cones[e].bound;
    middle_ = middle.head(n);
    solver_.release(a_free_, middle_);
    f_ = f.head(n) - middle_;
    const double error = solver_.solve(f_);
    f.head(n) = f_ + middle_;
    f_moved_ = f.head(n);
    is_moved_ = true;
    return error;
}

bool SeparateTrees::hold(const std::vector<char>& rests, const VecX& middle, VecX& f) {
    exert(middle, f);
    for (size_t e = 0; e < rests.size(); ++e) solver_.problem.elements[e].rests = rests[e];
    const bool held = solver_.hold(f_);
    f.head(solver_.problem.rows) = f_ + middle_;
    f_moved_ = f.head(solver_.problem.rows);
    return held;
}

// Compute the motion under the forces f, of which `middle` are constant, unless it is known.
void SeparateTrees::exert(const VecX& middle, const VecX& f) {
    const int n = solver_.problem.rows;
    middle_ = middle.head(n);
    f_ = f.head(n) - middle_;
    if (is_moved_ && f_moved_ == f.head(n)) return;
    solver_.release(a_free_, middle_);
    solver_.move(f_);
    f_moved_ = f.head(n);
    is_moved_ = true;
}

void SeparateTrees::move(const VecX& middle, const VecX& f, VecX& a, VecX& w) {
    exert(middle, f);
    a = a_free_;
    solver_.motion(a);
    w.head(solver_.problem.rows) = solver_.w();
}

void SeparateTrees::add_multipliers(const Program& p, Workspace& w, const std::vector<StepRow>& rows, const VecX& f,
                                    const VecX& a, VecX& lam) {
    if (blocks_.held().empty()) return;
    force_.setZero(p.mechanism.nv);
    rows_.setZero(p.layout.rows);
    for (size_t i = 0; i < rows.size(); ++i) {
        const Block& block = p.blocks[rows[i].block];
        rows_[block.row + rows[i].k] = f[i];
        if (i + 1 < rows.size() && rows[i + 1].block == rows[i].block) continue;
        add_transpose(block, w.now.A, rows_, force_);
        rows_.segment(block.row, block.kept.size()).setZero();
    }
    change_ = a - a_free_;
    inertia_.resize(p.mechanism.nv);
    multiply_M(p.mechanism, w.now.terms, change_, inertia_);
    for (const TreeBlocks::Held& held : blocks_.held())
        lam[p.blocks[held.block].row] += inertia_[held.dof] - force_[held.dof];
}

// Compute the largest of the terms that cancel in the acceleration of each tree: the acceleration without forces, and
// the responses to the forces of its elements.
void SeparateTrees::measure_balance() {
    const BlockProblem& problem = solver_.problem;
    balanced_.clear();
    for (const BlockNode& node : problem.nodes)
        balanced_.push_back(a_free_.segment(node.first, node.size).cwiseAbs().maxCoeff());
    for (const BlockElement& e : problem.elements)
        for (int row = e.row; row < e.row + e.dim(); ++row)
            for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
                double& most = balanced_[e.node[side]];
                most = std::max(most, std::abs(solver_.own_response(row, f_moved_)));
            }
}

void SeparateTrees::keep_rest(double h, const VecX& v0, VecX& v1) {
    measure_balance();
    for (size_t n = 0; n < balanced_.size(); ++n) {
        const BlockNode& node = solver_.problem.nodes[n];
        if ((v0.segment(node.first, node.size).array() != 0.0).any()) continue;
        const double left = v1.segment(node.first, node.size).cwiseAbs().maxCoeff();
        if (left <= tree_acceleration_rounding * h * balanced_[n]) v1.segment(node.first, node.size).setZero();
    }
}

ConeResiduals SeparateTrees::residuals(const VecX& middle, const VecX& f) {
    exert(middle, f);
    return solver_.residuals(f_);
}

}  // namespace pn
