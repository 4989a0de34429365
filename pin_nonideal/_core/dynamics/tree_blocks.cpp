#include "dynamics/tree_blocks.hpp"

#include <algorithm>
#include <cmath>

#include "tree/articulated.hpp"

namespace pn {

// Ratio of the pivots of one tree beyond which the forces on its bodies lose too many digits.
constexpr double max_pivot_ratio = 1e6;
// Largest number of dofs of a deep tree whose inertia becomes a matrix. The cost of its factor grows with the cube of the
// number, and the rounding error with the fourth power of the depth.
constexpr int max_deep_dofs = 200;

TreeBlocks::TreeBlocks(const Program& p)
    : size_(p.mechanism.nv, 0), is_held_(p.mechanism.nv, 0), node_(p.mechanism.nv, -1) {
    const Mechanism& m = p.mechanism;
    for (int dof = 0; dof < m.nv; ++dof) {
        const int root = m.dof_parent[dof] < 0 ? dof : root_[m.dof_parent[dof]];
        root_.push_back(root);
        local_.push_back(size_[root]++);
        applies_ = applies_ && root + local_[dof] == dof && (!m.is_deep[dof] || size_[root] <= max_deep_dofs);
    }
}

void TreeBlocks::hold_prescribed(const Program& p) {
    for (int i = 0; i < p.first_gap; ++i) {
        const Block& block = p.blocks[i];
        if (block.kept.empty()) continue;
        const MotionRows* motion = std::get_if<MotionRows>(&block.kind);
        const int dof = motion ? p.mechanism.joints[motion->joint].iv : -1;
        applies_ = applies_ && motion && !is_held_[dof];  // two motions of one dof may contradict each other
        if (!applies_) return;
        held_.push_back({i, dof});
        is_held_[dof] = 1;
    }
}

void TreeBlocks::add_held(const VecX& x, VecX& rows) const {
    for (const HeldEntry& entry : held_entries_) rows[entry.row] += entry.value * x[entry.dof];
}

// Check if the row of a block moves a dof that is not held.
bool TreeBlocks::moves(const Block& block) const {
    return std::any_of(block.support().begin(), block.support().end(), [&](int dof) { return !is_held_[dof]; });
}

// Check the ratio of the pivots of a tree, in units of its dofs. Pivots of different trees may differ by any factor.
bool TreeBlocks::is_well_conditioned(const Program& p, const Workspace& w, int root) const {
    double least = HUGE_VAL, most = 0.0;
    for (int dof = root; dof < root + size_[root]; ++dof) {
        const double unit = p.mechanism.unit[dof], pivot = unit * unit * w.now.terms.D[dof];
        least = std::min(least, pivot);
        most = std::max(most, pivot);
    }
    return most <= max_pivot_ratio * least;
}

bool TreeBlocks::has_slow_tree(const VecX& v, double most) const {
    for (size_t root = 0; root < size_.size(); ++root) {
        if (size_[root] == 0) continue;
        const double speed = v.segment(static_cast<Eigen::Index>(root), size_[root]).cwiseAbs().maxCoeff();
        if (speed > 0.0 && speed <= most) return true;
    }
    return false;
}

// Fill the inertia matrix of a tree.
void TreeBlocks::fill_inertia(const Program& p, const Workspace& w, int root, BlockMap M) {
    if (p.mechanism.is_deep[root])
        return mass_matrix_articulated(p.mechanism, w.now.terms, root, size_[root], composite_, M.data());
    for (int dof = root; dof < root + size_[root]; ++dof) {
        const int begin = p.mechanism.row_offset[dof];
        for (int s = 0; s <= p.mechanism.depth[dof]; ++s) {
            const int j = local_[p.mechanism.ancestors[begin + s]];
            M(local_[dof], j) = M(j, local_[dof]) = w.now.terms.M[begin + s];
        }
    }
}

// Remove the held dofs of a tree from its inertia matrix.
void TreeBlocks::hold(int root, BlockMap M) const {
    for (const Held& held : held_) {
        if (root_[held.dof] != root) continue;
        const int i = local_[held.dof];
        M.row(i).setZero();
        M.col(i).setZero();
        M(i, i) = 1.0;
    }
}

int TreeBlocks::node_of(const Program& p, const Workspace& w, int root, BlockProblem& problem) {
    int& node = node_[root];
    if (node >= 0) return node;
    node = static_cast<int>(problem.nodes.size());
    const BlockMap M = problem.add_node(size_[root], root);
    fill_inertia(p, w, root, M);
    hold(root, M);
    return node;
}

void TreeBlocks::follow_held(const Program& p, const Workspace& w, VecX& x) {
    for (size_t k = 0; k < held_.size(); ++k) {
        const int root = root_[held_[k].dof], size = size_[root];
        const auto is_of_tree = [&](const Held& held) { return root_[held.dof] == root; };
        if (size == 1 || std::any_of(held_.begin(), held_.begin() + k, is_of_tree)) continue;
        inertia_.assign(static_cast<size_t>(size) * size, 0.0);
        const BlockMap M(inertia_.data(), size, size);
        fill_inertia(p, w, root, M);
        auto own = x.segment(root, size);
        VecX force = -M * own;
        for (const Held& held : held_)
            if (is_of_tree(held)) force[local_[held.dof]] = x[held.dof];
        hold(root, M);
        own = M.llt().solve(force);
    }
}

bool TreeBlocks::fill(const Program& p, const Workspace& w, const std::vector<StepRow>& rows,
                      const std::vector<ConeElement>& cones, BlockProblem& problem) {
    problem.clear();
    held_entries_.clear();
    std::fill(node_.begin(), node_.end(), -1);
    size_t at = 0;
    for (const ConeElement& cone : cones) {
        int trees[2] = {-1, -1};
        for (int k = 0; k < cone.dim; ++k)
            for (int dof : p.blocks[rows[at + k].block].support()) {
                const int root = root_[dof];
                if (is_held_[dof] || root == trees[0] || root == trees[1]) continue;
                if (trees[1] >= 0) return false;
                trees[trees[0] >= 0] = root;
            }
        // The joint of a prescribed motion does not respond to its own friction. A contact must be able to open.
        if (trees[0] < 0 && !held_.empty() && cone.is(ConeKind::box))
            trees[0] = root_[p.blocks[rows[at].block].support().front()];
        if (trees[0] < 0) return false;
        for (int root : trees)
            if (root >= 0 && !is_well_conditioned(p, w, root)) return false;
        const int first = node_of(p, w, trees[0], problem);
        const int second = trees[1] < 0 ? -1 : node_of(p, w, trees[1], problem);
        BlockElement& e = problem.elements[problem.add_element(cone, first, second)];
        for (int k = 0; k < cone.dim; ++k, ++at) {
            const Block& block = p.blocks[rows[at].block];
            if (!held_.empty() && cone.is(ConeKind::contact) && !moves(block)) return false;
            const double* entry = w.now.A.data() + block.offset + rows[at].k;
            for (int dof : block.support()) {
                if (is_held_[dof]) held_entries_.push_back({static_cast<int>(at), dof, *entry});
                else problem.jacobian(e, root_[dof] != trees[0])(k, local_[dof]) = *entry;
                entry += block.kept.size();
            }
            if (cone.dim == 1 && block.dof >= 0) e.column = local_[block.dof];
        }
    }
    return true;
}

}  // namespace pn
