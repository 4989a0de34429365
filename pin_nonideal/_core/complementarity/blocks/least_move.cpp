#include "complementarity/blocks/least_move.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

bool LeastMove::pose() {
    if (!problem.factor()) return false;
    islands_.find(problem);
    if (static_cast<int>(factors_.size()) < islands_.size()) factors_.resize(islands_.size());
    factored_.assign(islands_.size(), 0);
    probed_.assign(islands_.size(), 0);
    island_of_.assign(problem.nodes.size(), -1);
    immobile_.assign(problem.nodes.size(), 0);
    for (int i = 0; i < islands_.size(); ++i)
        for (int node : islands_[i].nodes) island_of_[node] = i;
    weight_.assign(islands_.size(), parameters.max_weight);
    own_response_.resize(problem.rows);
    if (scaled_.size() < problem.rows) scaled_.resize(problem.rows);
    G_.assign(9 * problem.elements.size(), 0.0);
    return true;
}

bool LeastMove::factor(int i) {
    if (factored_[i]) return factored_[i] > 0;
    responses_.resize(problem.elements.size());
    problem.own_responses(islands_[i].elements, responses_);
    for (int k : islands_[i].elements) {
        const BlockElement& e = problem.elements[k];
        const Mat3& W = responses_[k];
        double most = 0.0;
        for (int r = 0; r < e.dim(); ++r) most = std::max(most, W.c[r][r]);
        for (int r = 0; r < e.dim(); ++r) {
            own_response_[e.row + r] = W.c[r][r] > min_block_response * most ? W.c[r][r] : most;
            G_[9 * k + r * (e.dim() + 1)] = own_response_[e.row + r] > 0.0 ? weight_[i] / own_response_[e.row + r] : 0.0;
        }
    }
    factors_[i].analyse(problem, islands_[i]);
    factored_[i] = factors_[i].factor(problem, islands_[i], G_, true) ? 1 : -1;
    return factored_[i] > 0;
}

// Largest displacement of an unknown of a node, as a length.
double LeastMove::length(const BlockNode& node, const VecX& move) const {
    const auto own = [&node](const VecX& x) { return x.segment(node.first, node.size).array(); };
    return (own(move) * own(lever)).abs().maxCoeff();
}

// Largest displacement of the moves that reduce single residuals to zero.
double LeastMove::longest_single(int i, const VecX& r) {
    double longest = 0.0;
    scaled_.setZero();
    for (int k : islands_[i].elements) {
        const BlockElement& e = problem.elements[k];
        for (int row = e.row; row < e.row + e.dim(); ++row) {
            if (r[row] == 0.0 || !(own_response_[row] > 0.0)) continue;
            for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
                const BlockNode& node = problem.nodes[e.node[side]];
                single_.segment(node.first, node.size).setZero();
            }
            scaled_[row] = r[row] / own_response_[row];
            problem.push(e, scaled_, single_);
            scaled_[row] = 0.0;
            for (int side = 0; side < 2 && e.node[side] >= 0; ++side) {
                const BlockNode& node = problem.nodes[e.node[side]];
                problem.solve_mass(e.node[side], single_);
                longest = std::max(longest, length(node, single_));
            }
        }
    }
    return longest;
}

// Replace a move by the move due to its forces f = -G (r + J dx) on the rows, which are equal and opposite on two nodes.
void LeastMove::exert(int i, const VecX& r, VecX& move) {
    for (int k : islands_[i].elements) {
        const BlockElement& e = problem.elements[k];
        problem.respond(e, move, scaled_);
        for (int row = 0; row < e.dim(); ++row) {
            double& force = scaled_[e.row + row];
            force = -G_[9 * k + row * (e.dim() + 1)] * (r[e.row + row] + force);
        }
    }
    for (int n : islands_[i].nodes) move.segment(problem.nodes[n].first, problem.nodes[n].size).setZero();
    for (int k : islands_[i].elements) problem.push(problem.elements[k], scaled_, move);
    for (int n : islands_[i].nodes) problem.solve_mass(n, move);
}

// Compute the move of an island. Lower the weights while it is too long.
bool LeastMove::seek(int i, const VecX& r, VecX& move) {
    double longest = -1.0;
    for (; weight_[i] >= 1.0; weight_[i] *= parameters.weight_ratio, factored_[i] = 0) {
        if (!factor(i)) return false;
        double size = 0.0, residual = 0.0;
        for (int n : islands_[i].nodes) move.segment(problem.nodes[n].first, problem.nodes[n].size).setZero();
        for (int k : islands_[i].elements) {
            const BlockElement& e = problem.elements[k];
            for (int row = 0; row < e.dim(); ++row) {
                residual = std::max(residual, std::abs(r[e.row + row]));
                scaled_[e.row + row] = -G_[9 * k + row * (e.dim() + 1)] * r[e.row + row];
            }
            problem.push(e, scaled_, move);
        }
        factors_[i].solve(move);
        exert(i, r, move);
        for (int n : islands_[i].nodes) size = std::max(size, length(problem.nodes[n], move));
        if (size <= parameters.max_move_ratio * residual) return true;
        if (longest < 0.0) longest = longest_single(i, r);
        if (size <= parameters.max_move_ratio * longest) return true;
    }
    for (int n : islands_[i].nodes) move.segment(problem.nodes[n].first, problem.nodes[n].size).setZero();
    return false;
}

bool LeastMove::find(const VecX& r, double floor, VecX& move) {
    bool moves = false;
    move.setZero();
    single_.resize(move.size());
    for (int i = 0; i < islands_.size(); ++i) {
        double largest = 0.0;
        for (int k : islands_[i].elements) {
            const BlockElement& e = problem.elements[k];
            largest = std::max(largest, r.segment(e.row, e.dim()).cwiseAbs().maxCoeff());
        }
        if (largest > floor) moves |= seek(i, r, move);
    }
    return moves;
}

// Move the nodes of an island at random, against the weighted rows. If the rows leave a freedom, the part of the motion
// along this freedom is unchanged: (M + J^T G J)^-1 M x = x.
void LeastMove::probe(int i) {
    probed_[i] = 1;
    if (!factor(i)) return;
    probe_.setZero(problem.nodes.empty() ? 0 : problem.nodes.back().first + problem.nodes.back().size);
    for (const BlockNode& node : problem.nodes)
        if (probe_.size() < node.first + node.size) probe_.conservativeResize(node.first + node.size);
    const auto part = [](int k) { return 0.5 + std::fmod(0.6180339887498949 * (k + 1), 1.0); };  // 0.5 ... 1.5, spread
    for (int n : islands_[i].nodes) {
        const BlockNode& node = problem.nodes[n];
        const double* M = problem.M.data() + node.M;
        for (int k = 0; k < node.size; ++k) {
            probe_[node.first + k] = 0.0;
            for (int l = 0; l < node.size; ++l)
                probe_[node.first + k] += M[k * node.size + l] * part(node.first + l) / std::sqrt(M[l * (node.size + 1)]);
        }
    }
    factors_[i].solve(probe_);
    for (int n : islands_[i].nodes) {
        const BlockNode& node = problem.nodes[n];
        const double* M = problem.M.data() + node.M;
        immobile_[n] = 1;
        for (int k = 0; k < node.size; ++k)
            if (!(std::abs(probe_[node.first + k]) * std::sqrt(M[k * (node.size + 1)]) <= parameters.max_unheld_part))
                immobile_[n] = 0;
    }
}

bool LeastMove::is_immobile(int node) {
    const int i = island_of_[node];
    if (i < 0) return false;
    if (!probed_[i]) probe(i);
    return immobile_[node];
}

}  // namespace pn
