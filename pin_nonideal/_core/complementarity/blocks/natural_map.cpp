// Natural map e(f) = P(f - rho w) - f of BlockNewton: projections on the cones, errors, and projected Gauss-Seidel sweeps.
#include <algorithm>
#include <cmath>

#include "complementarity/blocks/newton.hpp"

namespace pn {

void BlockNewton::pose(const BlockProblem& p) {
    rho_.assign(p.rows, 0.0);
    root_rho_.assign(p.rows, 0.0);
    G_.assign(9 * p.elements.size(), 0.0);
    piece_.assign(p.elements.size(), Piece::unknown);
    there_.resize(p.elements.size());
    for (VecX* x : {&y_, &e_, &z_, &df_, &dw_, &f_try_, &w_try_, &f_best_}) x->resize(p.rows);
    dx_.resize(p.free.size());
    for (const BlockElement& e : p.elements) {
        const Mat3 W = p.own_response(e);
        const int head = e.head(), tail = e.dim() - head;
        const double normal = head ? W.c[0][0] : 0.0;
        double across = 0.0;
        for (int k = head; k < e.dim(); ++k) across += W.c[k][k] / tail;
        const double most = std::max(normal, across);
        const auto inverse = [&](double own) {
            return most > 0.0 ? 1.0 / (own > min_block_response * most ? own : most) : 1.0;
        };
        for (int k = 0; k < e.dim(); ++k) {
            rho_[e.row + k] = inverse(k < head ? normal : across);
            root_rho_[e.row + k] = std::sqrt(rho_[e.row + k]);
        }
    }
}

void BlockNewton::move(const BlockProblem& p, const Island& island, const VecX& f, VecX& x, VecX& w) const {
    for (int n : island.nodes) x.segment(p.nodes[n].first, p.nodes[n].size).setZero();
    for (int i : island.elements) p.push(p.elements[i], f, x);
    for (int n : island.nodes) {
        p.solve_mass(n, x);
        x.segment(p.nodes[n].first, p.nodes[n].size) += p.free.segment(p.nodes[n].first, p.nodes[n].size);
    }
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        p.respond(e, x, w);
        for (int k = 0; k < e.dim(); ++k) w[e.row + k] += p.offset[e.row + k];
    }
}

BlockNewton::Projection BlockNewton::projection(const BlockElement& e, const double* y) const {
    Projection out;
    const int head = e.head(), d = e.dim();
    double radius = e.cone.bound;
    if (e.cone.is(ConeKind::equality)) {
        out.piece = Piece::sticks;
        std::copy(y, y + d, out.P);
        return out;
    }
    if (head) {
        if (!(y[0] > 0.0)) return out;
        out.P[0] = y[0];
        radius *= y[0];
    }
    double square = 0.0;
    for (int k = head; k < d; ++k) square += y[k] * y[k];
    const double length = std::sqrt(square);
    if (length <= radius || d == head) {
        out.piece = Piece::sticks;
        std::copy(y + head, y + d, out.P + head);
        return out;
    }
    out.piece = Piece::slips;
    out.ratio = radius / length;
    for (int k = head; k < d; ++k) {
        out.t[k] = y[k] / length;
        out.P[k] = radius * out.t[k];
    }
    return out;
}

bool BlockNewton::project(const BlockProblem& p, const Island& island, VecX& f) const {
    bool changes = false;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        const Projection there = projection(e, f.data() + e.row);
        for (int k = 0; k < e.dim(); ++k) {
            changes |= f[e.row + k] != there.P[k];
            f[e.row + k] = there.P[k];
        }
    }
    return changes;
}

void BlockNewton::sweep(const BlockProblem& p, const Island& island, int sweeps, VecX& f, VecX& x, VecX& w) {
    move(p, island, f, x, w);
    for (int sweep = 0; sweep < sweeps; ++sweep)
        for (int i : island.elements) {
            const BlockElement& e = p.elements[i];
            p.respond(e, x, w);
            for (int r = e.row; r < e.row + e.dim(); ++r) y_[r] = f[r] - rho_[r] * (w[r] + p.offset[r]);
            const Projection there = projection(e, y_.data() + e.row);
            for (int k = 0; k < e.dim(); ++k) {
                df_[e.row + k] = there.P[k] - f[e.row + k];
                f[e.row + k] = there.P[k];
            }
            for (int n : e.node)
                if (n >= 0) dx_.segment(p.nodes[n].first, p.nodes[n].size).setZero();
            p.push(e, df_, dx_);
            for (int n : e.node) {
                if (n < 0) continue;
                p.solve_mass(n, dx_);
                x.segment(p.nodes[n].first, p.nodes[n].size) += dx_.segment(p.nodes[n].first, p.nodes[n].size);
            }
        }
}

// Evaluate the errors e and their squared length in units of energy. Return the largest error of an element relative to
// its forces, or to those of the largest free velocity.
double BlockNewton::evaluate(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, double& merit) {
    merit = 0.0;
    double worst = 0.0;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        for (int r = e.row; r < e.row + e.dim(); ++r) y_[r] = (1.0 - compliance_) * f[r] - rho_[r] * w[r];
        const Projection& there = there_[i] = projection(e, y_.data() + e.row);
        double error = 0.0, size = unit_;
        for (int k = 0; k < e.dim(); ++k) {
            const int r = e.row + k;
            e_[r] = there.P[k] - f[r];
            merit += e_[r] * e_[r] / rho_[r];
            error = std::max(error, std::abs(e_[r]) / root_rho_[r]);
            size = std::max(size, std::abs(f[r]) / root_rho_[r]);
        }
        if (!(error < HUGE_VAL)) worst = HUGE_VAL;
        else if (error > 0.0) worst = std::max(worst, error / size);
    }
    return worst;
}

void BlockNewton::worst(const BlockProblem& p, const Island& island, const VecX& f, const VecX& w, int& element,
                        double& velocity) const {
    double largest = -1.0;
    for (int i : island.elements) {
        const BlockElement& e = p.elements[i];
        double y[3], error = 0.0, size = unit_, miss = 0.0;
        for (int k = 0; k < e.dim(); ++k) y[k] = f[e.row + k] - rho_[e.row + k] * w[e.row + k];
        const Projection there = projection(e, y);
        for (int k = 0; k < e.dim(); ++k) {
            const int r = e.row + k;
            const double distance = std::abs(there.P[k] - f[r]);
            error = std::max(error, distance / root_rho_[r]);
            size = std::max(size, std::abs(f[r]) / root_rho_[r]);
            miss = std::max(miss, distance / rho_[r]);
        }
        if (!(error > largest * size)) continue;
        largest = error / size;
        element = i;
        velocity = miss;
    }
}

}  // namespace pn
