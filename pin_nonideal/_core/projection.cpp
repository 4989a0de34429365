#include "projection.hpp"

#include <algorithm>
#include <cmath>

namespace pn {

namespace {

// x := R^-T B^T (B B^T)^-1 r, the least move in the metric of M that changes A x by r.
void least_move(const Program& p, Workspace& w, VecX& x) {
    solve_rows(p.layout, w.rows, w.r, w.lam);
    x.setZero();
    for (int i : w.rows.blocks) add_transpose(p.blocks[i], w.B, w.lam, x);
    solve_Rt(p.mechanism, w.terms, x);
}

void refactor(const Program& p, Workspace& w, double t) {
    inertia(p.mechanism, w.terms);
    factor_mass(p, w, t);
    scale_rows(p, w);
    factor_rows(p.layout, p.blocks, w.B, w.rows);
    ++w.factorizations;
}

// Negative residuals or rates of the rows in use; returns the largest.
double gather(const Program& p, Workspace& w, bool position) {
    double largest = 0.0;
    for (int i : w.rows.blocks) {
        const Block& block = p.blocks[i];
        const RowValues& values = w.values[i];
        for (size_t k = 0; k < block.kept.size(); ++k) {
            const double x = position ? values.residual[block.kept[k]] : values.rate[block.kept[k]];
            w.r[block.row + k] = -x;
            if (w.rows.active[block.row + k]) largest = std::max(largest, std::abs(x));
        }
    }
    return largest;
}

// Iterations left when each takes as much as the last one did; factors of the new place cost less than three of them.
double left_at_this_rate(double before, double now, double floor) {
    return now < before ? std::log(now / std::max(floor, 1e-16)) / std::log(before / now) : HUGE_VAL;
}

// The same for rates A v + phi_t after a change of v, which needs no new look at the motion.
double change_rates(const Program& p, Workspace& w, const VecX& change) {
    double largest = 0.0;
    for (int i : w.rows.blocks) {
        const Block& block = p.blocks[i];
        multiply(block, w.A, change, w.miss);
        for (size_t k = 0; k < block.kept.size(); ++k) {
            const int row = block.row + k;
            w.r[row] -= w.miss[row];
            if (w.rows.active[row]) largest = std::max(largest, std::abs(w.r[row]));
        }
    }
    return largest;
}

}  // namespace

double scene_size(const Workspace& w) {
    double square = 1.0;
    for (const Body& b : w.terms.body) square = std::max(square, (b.ref + b.p).squaredNorm());
    return std::sqrt(square);
}

// Size of a row of A, at least 1: a row that was scaled up leaves a gap as much larger.
static double row_size(const Workspace& w, const Block& block, int row) {
    double size = 1.0;
    const size_t n = block.kept.size();
    for (size_t k = 0; k < n; ++k) {
        if (block.kept[k] != row) continue;
        for (size_t l = 0; l < block.support.size(); ++l)
            size = std::max(size, std::abs(w.A[block.offset + l * n + k]));
    }
    return size;
}

void require_closed(const Program& p, const Workspace& w, double t) {
    const double allowed = open_gap * scene_size(w);
    double largest = 0.0;
    int worst = -1;
    for (int i = 0; i < p.constraints; ++i)
        for (int k = 0; k < w.values[i].rows; ++k) {
            const double gap = std::abs(w.values[i].residual[k]);
            if (gap <= allowed || gap <= allowed * row_size(w, p.blocks[i], k) || gap < largest) continue;
            largest = gap;
            worst = i;
        }
    if (worst >= 0) throw Failure(Failure::Kind::closure, t, {worst}, largest);
}

bool project(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    for (int dof = 0; dof < p.mechanism.nv; ++dof)
        if (w.terms.locked[dof]) v[dof] = 0.0;  // what sticks has exactly no velocity
    if (w.rows.blocks.empty()) return false;
    look_at(p, w, t, q, v);
    // Near a singular position what is left would come back magnified: there every bit counts.
    const double part = w.rows.distance < near_singular ? 0.0 : projection_floor;
    const double floor = part * scene_size(w);
    bool moved = false;
    double last = gather(p, w, true);
    for (int it = 0; it < projection_limit && last > floor; ++it) {
        least_move(p, w, w.scaled);
        w.trial = w.scaled;
        retract(p.mechanism, q.data(), w.trial.data(), q.data());
        moved = true;
        look_at(p, w, t, q, v);
        const double now = gather(p, w, true);
        if (now > floor && left_at_this_rate(last, now, floor) > 3.0) refactor(p, w, t);
        if (it > 3 && now > 0.5 * last) break;  // as good as rounding allows
        last = now;
    }
    const double speed = std::max(1.0, v.cwiseAbs().maxCoeff());
    last = gather(p, w, false);
    for (int it = 0; it < projection_limit && last > part * speed; ++it) {
        least_move(p, w, w.scaled);
        v += w.scaled;
        moved = true;
        const double now = p.affine_rates ? change_rates(p, w, w.scaled) : (look_at(p, w, t, q, v), gather(p, w, false));
        if (!(now < 0.1 * last)) refactor(p, w, t);
        if (it > 1 && now > 0.5 * last) break;
        last = now;
    }
    if (is_immobile(p, w) && v.cwiseAbs().maxCoeff() <= immobile_speed) v.setZero();
    if (moved) ++w.projections;
    return moved;
}

}  // namespace pn
