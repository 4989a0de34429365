#include "run/time_stepping/step_responses.hpp"

#include "dynamics/acceleration.hpp"
#include "math/lanes.hpp"
#include "math/tolerances.hpp"
#include "tree/mass_factor.hpp"

namespace pn {

namespace {

// Compute W = X^T X of the first n columns.
PN_WIDE void gram(const MatX& X, int n, MatX& W) {
    const int length = static_cast<int>(X.rows());
    for (int i = 0; i < n; ++i)
        for (int j = 0; j <= i; ++j) W(i, j) = W(j, i) = dot(X.col(i).data(), X.col(j).data(), length);
}

}  // namespace

StepResponses::StepResponses(const Program& p)
    : unit_(VecX::Zero(p.layout.rows)), zero_(unit_), lam_(unit_), free_response_(unit_),
      force_(VecX::Zero(p.mechanism.nv)), a_(force_) {}

void StepResponses::find(const Program& p, Workspace& w, const std::vector<StepRow>& rows) {
    const int n = static_cast<int>(rows.size());
    if (n == 0 || is_computed_) return;
    is_computed_ = true;
    if (W_.rows() < n) {
        W_.resize(n, n);
        response_.resize(p.mechanism.nv, n);
        multipliers_.resize(p.layout.rows, n);
    }
    scaled_ = !w.now.rows.refine;
    for (int column = 0; column < n; ++column) {
        const StepRow& row = rows[column];
        const Block& block = p.blocks[row.block];
        force_.setZero();
        unit_[block.row + row.k] = 1.0;
        add_transpose(block, w.now.A, unit_, force_);
        unit_[block.row + row.k] = 0.0;
        double free;
        if (scaled_) {
            free = solve_scaled(p, w, force_, nullptr, zero_, lam_);
            response_.col(column) = force_;
        } else {
            solve_acceleration(p, w, force_, zero_, a_, lam_);
            response_.col(column) = a_;
            solve_R(p.mechanism, w.now.terms, force_);
            free = force_.squaredNorm();
            for (int i = 0; i < n; ++i) {
                multiply(p.blocks[rows[i].block], w.now.A, a_, w.scratch.r);
                W_(i, column) = w.scratch.r[p.blocks[rows[i].block].row + rows[i].k];
            }
        }
        if (!w.now.rows.blocks.empty()) multipliers_.col(column) = lam_;
        free_response_[column] = free;
    }
    if (scaled_) gram(response_, n, W_);
    for (int i = 0; i < n; ++i)
        if (W_(i, i) <= min_constrained_response * free_response_[i]) W_(i, i) = 0.0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < i; ++j) {
            const bool held = W_(i, i) == 0.0 || W_(j, j) == 0.0;
            W_(i, j) = W_(j, i) = held ? 0.0 : 0.5 * (W_(i, j) + W_(j, i));
        }
}

void StepResponses::add_motion(const Program& p, Workspace& w, const VecX& f, int n, VecX& a) {
    force_.noalias() = response_.leftCols(n) * f.head(n);
    if (scaled_) solve_Rt(p.mechanism, w.now.terms, force_);
    a += force_;
}

void StepResponses::add_multipliers(const VecX& f, int n, VecX& lam) const {
    if (n > 0) lam.noalias() += multipliers_.leftCols(n) * f.head(n);
}

}  // namespace pn
