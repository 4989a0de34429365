#include "run/time_stepping/separate_trees.hpp"

#include <algorithm>

namespace pn {

// Ratio of the pivots of one tree beyond which the forces on its bodies lose too many digits.
constexpr double most_pivot_ratio = 1e6;

SeparateTrees::SeparateTrees(const Program& p) : size_(p.mechanism.nv, 0), node_(p.mechanism.nv, -1) {
    const Mechanism& m = p.mechanism;
    for (int dof = 0; dof < m.nv; ++dof) {
        const int root = m.dof_parent[dof] < 0 ? dof : root_[m.dof_parent[dof]];
        root_.push_back(root);
        local_.push_back(size_[root]++);
        contiguous_ = contiguous_ && root + local_[dof] == dof;
    }
    for (const Block& block : p.blocks) {
        std::vector<int> trees;
        for (int dof : block.support)
            if (std::find(trees.begin(), trees.end(), root_[dof]) == trees.end()) trees.push_back(root_[dof]);
        trees_.push_back(trees);
    }
}

// Check if the scene can be solved tree by tree now: no constraints act, and the inertia of every tree is a matrix.
bool SeparateTrees::applies(const Program& p, const Workspace& w) const {
    const std::vector<char>& locked = w.now.terms.locked;
    return contiguous_ && w.now.rows.blocks.empty() && p.mechanism.deep_dofs.empty() &&
           std::find(locked.begin(), locked.end(), char(1)) == locked.end();
}

// Check the ratio of the pivots of a tree. Those of different trees may differ by any factor.
bool SeparateTrees::is_well_conditioned(const Workspace& w, int root) const {
    const auto pivots = w.now.terms.D.segment(root, size_[root]);
    return pivots.maxCoeff() <= most_pivot_ratio * pivots.minCoeff();
}

int SeparateTrees::node_of(const Program& p, const Workspace& w, int root) {
    int& node = node_[root];
    if (node >= 0) return node;
    node = static_cast<int>(solver_.problem.nodes.size());
    BlockMap M = solver_.problem.add_node(size_[root], root);
    for (int dof = root; dof < root + size_[root]; ++dof) {
        const int begin = p.mechanism.row_offset[dof];
        for (int s = 0; s <= p.mechanism.depth[dof]; ++s) {
            const int j = local_[p.mechanism.ancestors[begin + s]];
            M(local_[dof], j) = M(j, local_[dof]) = w.now.terms.M[begin + s];
        }
    }
    return node;
}

bool SeparateTrees::pose(const Program& p, const Workspace& w, const std::vector<StepRow>& rows,
                         const std::vector<ConeElement>& cones, const VecX& a_free, const VecX& offset) {
    if (!applies(p, w)) return false;
    BlockProblem& problem = solver_.problem;
    problem.clear();
    std::fill(node_.begin(), node_.end(), -1);
    size_t at = 0;
    for (const ConeElement& cone : cones) {
        int trees[2] = {-1, -1};
        for (int k = 0; k < cone.dim; ++k)
            for (int root : trees_[rows[at + k].block]) {
                if (root == trees[0] || root == trees[1]) continue;
                if (trees[1] >= 0) return false;
                trees[trees[0] >= 0] = root;
            }
        if (trees[0] < 0) return false;
        if (!is_well_conditioned(w, trees[0]) || (trees[1] >= 0 && !is_well_conditioned(w, trees[1]))) return false;
        const int first = node_of(p, w, trees[0]), second = trees[1] < 0 ? -1 : node_of(p, w, trees[1]);
        BlockElement& e = problem.elements[problem.add_element(cone, first, second)];
        for (int k = 0; k < cone.dim; ++k, ++at) {
            const Block& block = p.blocks[rows[at].block];
            const double* entry = w.now.A.data() + block.offset + rows[at].k;
            for (int dof : block.support) {
                problem.jacobian(e, root_[dof] != trees[0])(k, local_[dof]) = *entry;
                entry += block.kept.size();
            }
            if (cone.dim == 1 && block.dof >= 0) e.column = local_[block.dof];
        }
    }
    problem.free = a_free;
    problem.offset = offset.head(problem.rows);
    f_.setZero(problem.rows);
    a_free_ = a_free;
    return solver_.pose();
}

void SeparateTrees::release(const VecX& a_free, const VecX& offset) {
    a_free_ = a_free;
    solver_.problem.offset = offset.head(solver_.problem.rows);
}

// Add forces to the motion without forces.
void SeparateTrees::shift(const VecX& middle) {
    BlockProblem& problem = solver_.problem;
    problem.free.setZero();
    for (const BlockElement& e : problem.elements) problem.push(e, middle, problem.free);
    for (size_t n = 0; n < problem.nodes.size(); ++n) problem.solve_mass(static_cast<int>(n), problem.free);
    problem.free += a_free_;
}

double SeparateTrees::solve(const std::vector<ConeElement>& cones, const VecX& middle, VecX& f) {
    const int n = solver_.problem.rows;
    for (size_t e = 0; e < cones.size(); ++e) solver_.problem.elements[e].cone.bound = cones[e].bound;
    shift(middle);
    f_ = f.head(n) - middle.head(n);
    const double error = solver_.solve(f_);
    f.head(n) = f_ + middle.head(n);
    return error;
}

void SeparateTrees::move(const VecX& f, VecX& a, VecX& w) {
    const int n = solver_.problem.rows;
    solver_.problem.free = a_free_;
    f_ = f.head(n);
    solver_.move(f_);
    a = a_free_;
    for (const BlockNode& node : solver_.problem.nodes)
        a.segment(node.first, node.size) = solver_.x().segment(node.first, node.size);
    w.head(n) = solver_.w();
}

ConeResiduals SeparateTrees::residuals(const VecX& middle, const VecX& f) {
    const int n = solver_.problem.rows;
    shift(middle);
    f_ = f.head(n) - middle.head(n);
    solver_.move(f_);
    return solver_.residuals(f_);
}

}  // namespace pn
