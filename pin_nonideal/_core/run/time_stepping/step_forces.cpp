#include "run/time_stepping/step_forces.hpp"

#include <algorithm>
#include <cmath>

#include "math/tolerances.hpp"

namespace pn {

StepForces::StepForces(const Program& program, Workspace& workspace, const StepElements& elements)
    : f(VecX::Zero(program.layout.rows)), end_rows(f), p(program), w(workspace), elements_(elements), trees_(program),
      responses_(program), free_rows_(f), offset_(f), middle_(f), a_(VecX::Zero(program.mechanism.nv)) {
    solver_.accept_residual(parameters.max_residual);
}

void StepForces::pose(const MeanVelocity& mean, double h, const VecX& a_free, bool anew) {
    measure_free(mean, h, a_free);
    if (anew) {
        responses_.reset();
        separate_ = !elements_.limits_follow_loads(p) &&
                    trees_.pose(p, w, elements_.rows, elements_.cones, a_free, offset_);
    } else if (separate_) {
        trees_.release(a_free, offset_);
    }
    if (!separate_) responses_.find(p, w, elements_.rows);
    recall_forces();
}

void StepForces::add_motion(VecX& a) {
    if (separate_) trees_.move(f, a, end_rows);
    else responses_.add_motion(p, w, f, static_cast<int>(elements_.rows.size()), a);
}

void StepForces::add_multipliers(VecX& lam) const {
    responses_.add_multipliers(f, static_cast<int>(elements_.rows.size()), lam);
}

// Compute the velocities at the step's end without the forces, over h.
void StepForces::measure_free(const MeanVelocity& mean, double h, const VecX& a_free) {
    const auto& rows = elements_.rows;
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(rows.size());
    for (int i = 0; i < n; ++i) {
        const Block& block = p.blocks[rows[i].block];
        if (i == 0 || rows[i].block != rows[i - 1].block) mean.start_rates(p, w, rows[i].block);
        const double bias = w.now.values[rows[i].block].bias[block.kept[rows[i].k]];
        offset_[i] = w.scratch.r[block.row + rows[i].k] / h + 0.5 * bias;
    }
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e)
        offset_[at] += parts[e].approach / h;
    for (int i = 0; i < n; ++i) {
        const Block& block = p.blocks[rows[i].block];
        if (i == 0 || rows[i].block != rows[i - 1].block) multiply(block, w.now.A, a_free, w.scratch.r);
        free_rows_[i] = offset_[i] + w.scratch.r[block.row + rows[i].k];
    }
}

// Guess the forces of the last step.
void StepForces::recall_forces() {
    for (size_t i = 0; i < elements_.rows.size(); ++i) {
        const StepRow& row = elements_.rows[i];
        f[i] = w.state.percussion[p.blocks[row.block].row + row.k];
    }
}

bool StepForces::solve(double h, const VecX& q0, const VecX& v0) {
    const int n = static_cast<int>(elements_.rows.size());
    elements_.middles(middle_);
    guess_ = f.head(n);
    const double error = separate_ ? trees_.solve(elements_.cones, middle_, f) : HUGE_VAL;
    bool solved = error <= parameters.max_residual;
    const bool starts = v0.cwiseAbs().maxCoeff() <= rest_speed && !(q_without_rest_.size() > 0 && q_without_rest_ == q0);
    if (solved && !(starts && moves())) return true;
    responses_.find(p, w, elements_.rows);
    if (!solved) {
        best_f_ = f.head(n);
        f.head(n) = guess_;
    }
    const auto W = responses_.matrix(n);
    f.head(n) -= middle_.head(n);
    end_rows.head(n) = free_rows_.head(n);
    end_rows.head(n).noalias() += W * middle_.head(n);
    solver_.search_briefly(error < BlockSolver::parameters.min_swept_error);
    if (!solved)
        solved = solver_.solve(W, end_rows.head(n), elements_.cones, true, f.head(n), true) == ConeStatus::solved &&
                 !add_energy(W, end_rows.head(n), f.head(n));
    if (starts) solved = keep_rest(solved, q0) || solved;
    f.head(n) += middle_.head(n);
    if (!solved && separate_ && trees_.miss().element >= 0) {
        f.head(n) = best_f_;
        accept_best_forces(h);
        return true;
    }
    return solved;
}

// Accept the best forces found, which violate the laws of contact by the error of one element.
void StepForces::accept_best_forces(double h) {
    const BlockSolver::Miss& miss = trees_.miss();
    const StepElements::Part& part = elements_.parts[miss.element];
    law_miss_ = {part.gap >= 0 ? p.gaps[part.gap].block : p.frictions[part.element].block, h * miss.velocity};
}

void StepForces::measure_end() {
    const int n = static_cast<int>(elements_.rows.size());
    if (separate_) return trees_.move(f, a_, end_rows);
    end_rows.head(n) = free_rows_.head(n);
    end_rows.head(n).noalias() += responses_.matrix(n) * f.head(n);
}

bool StepForces::moves() {
    const int n = static_cast<int>(elements_.rows.size());
    measure_end();
    if (separate_) return !trees_.rests(a_);
    return end_rows.head(n).cwiseAbs().maxCoeff() >
           parameters.rest_rounding * free_rows_.head(n).cwiseAbs().maxCoeff();
}

// Check if forces within all cones hold the bodies at rest, and set f to such forces. The rows without forces are in
// end_rows.
bool StepForces::keep_rest(bool solved, const VecX& q0) {
    const int n = static_cast<int>(elements_.rows.size());
    const auto W = responses_.matrix(n);
    const bool moves = (end_rows.head(n) + W * f.head(n)).cwiseAbs().maxCoeff() >
                       parameters.rest_rounding * end_rows.head(n).cwiseAbs().maxCoeff();
    if (solved && !moves) return false;
    const bool holds = solver_.hold(W, end_rows.head(n), elements_.cones, f.head(n));
    if (!holds) q_without_rest_ = q0;  // the next sweeps and the step after the start skip this check
    return holds;
}

ConeResiduals StepForces::residuals() {
    const int n = static_cast<int>(elements_.rows.size());
    if (separate_) return trees_.residuals(middle_, f);
    const auto W = responses_.matrix(n);
    end_rows.head(n) = free_rows_.head(n);
    end_rows.head(n).noalias() += W * middle_.head(n);
    return cone_residuals(W, end_rows.head(n), elements_.cones, f.head(n) - middle_.head(n));
}

}  // namespace pn
