#include "run/time_stepping/step_forces.hpp"

#include <algorithm>
#include <cmath>

#include "math/tolerances.hpp"

namespace pn {

StepForces::StepForces(const Program& program, Workspace& workspace, const StepElements& elements)
    : f(VecX::Zero(program.layout.rows)), end_rows(f), p(program), w(workspace), elements_(elements), trees_(program),
      responses_(program), free_rows_(f), offset_(f), middle_(f), a_(VecX::Zero(program.mechanism.nv)) {
    solver_.accept_residual(parameters.max_residual);
    solver_.use_uniform_compliance(true);
}

void StepForces::pose(const MeanVelocity& mean, double h, const VecX& a_free, bool anew) {
    if (anew) are_dependent_ = false;
    measure_free(mean, h, a_free);
    const double largest = a_free.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
    const auto free = free_rows_.head(static_cast<Eigen::Index>(elements_.rows.size()));
    has_load_ = (free.array().abs() > parameters.row_rounding * largest).any();
    if (anew) {
        responses_.reset();
        separate_ = !elements_.limits_follow_loads(p) && !has_few_boxes() &&
                    trees_.pose(p, w, elements_.rows, elements_.cones, a_free, offset_);
    } else if (separate_) {
        trees_.release(a_free, offset_);
    }
    if (!separate_) responses_.find(p, w, elements_.rows);
    recall_forces();
    if (separate_) return;
    if (anew) find_dependent();
    unload_held(mean, a_free);
}

void StepForces::find_dependent() {
    dry_rows_.clear();
    if (!elements_.limits_follow_loads(p) || w.now.rows.blocks.empty()) return;
    for (size_t e = 0, at = 0; e < elements_.parts.size(); at += elements_.cones[e].dim, ++e)
        if (elements_.parts[e].gap < 0)
            for (int k = 0; k < elements_.cones[e].dim; ++k) dry_rows_.push_back(static_cast<int>(at) + k);
    are_dependent_ = SharedFriction::are_dependent(responses_.matrix(static_cast<int>(elements_.rows.size())), dry_rows_);
}

void StepForces::share_loads(double h, const VecX& v0) {
    const int n = static_cast<int>(elements_.rows.size());
    const double clear = parameters.limit_rounding * f.head(n).cwiseAbs().maxCoeff(), still = rest_rate(v0) / h;
    measure_end();
    sticking_.clear();
    for (int e = 0, at = 0; e < static_cast<int>(elements_.parts.size()); at += elements_.cones[e].dim, ++e) {
        const ConeElement& cone = elements_.cones[e];
        if (elements_.parts[e].gap >= 0 || !(cone.bound > 0.0)) continue;
        if (elements_.limit_left(e, at, f) <= clear && end_rows.segment(at, cone.dim).norm() > still) continue;
        sticking_.push_back({at, cone.dim, cone.bound, elements_.parts[e].middle});
    }
    shared_.share(responses_.matrix(n), sticking_, f);
}

void StepForces::drop_prevented_slip() {
    recall_forces();
    const auto W = responses_.matrix(static_cast<int>(elements_.rows.size()));
    std::vector<int> rows;
    for (size_t e = 0, at = 0; e < elements_.parts.size(); at += elements_.cones[e].dim, ++e)
        for (int i = static_cast<int>(at); i < static_cast<int>(at) + elements_.cones[e].dim; ++i)
            if (elements_.parts[e].gap < 0 && !p.follows_drives(elements_.parts[e].element) && W(i, i) > 0.0)
                rows.push_back(i);
    SharedFriction::drop_prevented_slip(W, rows, free_rows_);
}

// Remove friction from elements that the constraints alone hold. The rounding error of their slip has no sign.
void StepForces::unload_held(const MeanVelocity& mean, const VecX& a_free) {
    const auto W = responses_.matrix(static_cast<int>(elements_.rows.size()));
    if (W.diagonal().all()) return;
    const double rounding = mean.held_slip(p, a_free);
    for (size_t e = 0, at = 0; e < elements_.parts.size(); at += elements_.cones[e].dim, ++e) {
        const int dim = elements_.cones[e].dim;
        if (elements_.parts[e].gap >= 0 || W.diagonal().segment(at, dim).any()) continue;
        if (free_rows_.segment(at, dim).norm() > rounding) continue;
        free_rows_.segment(at, dim).setZero();
        f.segment(at, dim).setZero();
    }
}

void StepForces::add_motion(VecX& a) {
    if (separate_) trees_.move(middle_, f, a, end_rows);
    else responses_.add_motion(p, w, f, static_cast<int>(elements_.rows.size()), a);
}

void StepForces::add_multipliers(VecX& lam) {
    if (separate_) trees_.add_multipliers(p, w, elements_.rows, f, w.now.a, lam);
    else responses_.add_multipliers(f, static_cast<int>(elements_.rows.size()), lam);
}

namespace {

// Return a bound of the rates of a row between two bodies: the speeds of both bodies at its point, whatever its direction.
double rate_bound(const Terms& terms, const Block& block, const Vec3& point) {
    double bound = 0.0;
    for (const int joint : {block.joint1, block.joint2}) {
        if (joint == 0) continue;
        const Body& body = terms.body[joint];
        const Vec3 origin = body.ref + body.p;
        bound += velocity_at(body, origin).norm() + body.v.ang.norm() * (point - origin).norm();
    }
    return bound;
}

// Return the part of a row's bias that its bodies accelerate, with the directions of the row held.
double acceleration_of_bodies(const Mechanism& m, const Terms& terms, const Block& block, const Wrench& unit) {
    double sum = 0.0;
    if (block.joint1 > 0) sum += unit.force.dot(acceleration_at(m, terms.body[block.joint1], unit.point));
    if (block.joint2 > 0) sum -= unit.force.dot(acceleration_at(m, terms.body[block.joint2], unit.point));
    return sum;
}

}  // namespace

// Half of the change of a row's rate in a step at zero acceleration of the joints, divided by the step. At edges of small
// rounding radius the directions turn far within a step. The rate is not linear in the step then, and the direction at the
// middle of the step serves for the whole step.
double StepForces::turning_rate(const StepRow& row, double h) const {
    const Block& block = p.blocks[row.block];
    const RowValues& values = w.now.values[row.block];
    const int k = block.kept[row.k];
    const double bias = values.bias[k];
    if (!values.geometric) return 0.5 * bias;
    const Wrench& unit = values.wrench[k];
    const double turn = bias - acceleration_of_bodies(p.mechanism, w.now.terms, block, unit);
    const double bound = parameters.max_turn * rate_bound(w.now.terms, block, unit.point);
    return 0.5 * h * std::abs(turn) <= bound ? 0.5 * bias : 0.0;
}

// Compute the velocities at the step's end without the forces, divided by h.
void StepForces::measure_free(const MeanVelocity& mean, double h, const VecX& a_free) {
    const auto& rows = elements_.rows;
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(rows.size());
    for (int i = 0; i < n; ++i) {
        const Block& block = p.blocks[rows[i].block];
        if (i == 0 || rows[i].block != rows[i - 1].block) mean.start_rates(p, w, rows[i].block);
        offset_[i] = w.scratch.r[block.row + rows[i].k] / h + turning_rate(rows[i], h);
    }
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        offset_[at] += parts[e].approach / h;
        // The turn of its normal may close the gap of a contact that strikes: an impulse against this part would add
        // energy.
        if (parts[e].strikes) offset_[at] -= std::min(0.0, turning_rate(rows[at], h));
    }
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
    elements_.middles(middle_);
    guess_ = f.head(static_cast<Eigen::Index>(elements_.rows.size()));
    status_ = ConeStatus::solved;
    const VecX& without_rest = w.state.q_without_rest;
    const bool may_rest = !(without_rest.size() > 0 && without_rest == q0);
    if (!separate_) return solve_with_responses(may_rest && v0.cwiseAbs().maxCoeff() <= rest_speed, q0);
    error_ = trees_.solve(elements_.cones, middle_, f);
    if (may_rest) hold_resting(q0);
    if (error_ <= parameters.max_residual) return true;
    best_f_ = f.head(guess_.size());
    if (guess_.size() <= parameters.max_rows_with_responses && solve_with_responses(false, q0)) return true;
    return accept_best_forces(h);
}

// Solve the laws with the responses of all rows. `starts`: the bodies may be held at rest at q0.
bool StepForces::solve_with_responses(bool starts, const VecX& q0) {
    const int n = static_cast<int>(elements_.rows.size());
    responses_.find(p, w, elements_.rows);
    f.head(n) = guess_ - middle_.head(n);
    end_rows.head(n) = free_rows_.head(n);
    end_rows.head(n).noalias() += responses_.matrix(n) * middle_.head(n);
    const bool solved = has_boxes_only() ? solve_boxes() : solve_cones(starts, q0);
    f.head(n) += middle_.head(n);
    return solved;
}

// Check if every element is dry friction in one direction.
bool StepForces::has_boxes_only() const {
    return std::all_of(elements_.cones.begin(), elements_.cones.end(),
                       [](const ConeElement& cone) { return cone.is(ConeKind::box) && cone.dim == 1; });
}

// Check if the scene has no contacts and no constraints, and few joints with dry friction.
bool StepForces::has_few_boxes() const {
    return p.gaps.empty() && w.now.rows.blocks.empty() && has_boxes_only() &&
           static_cast<int>(elements_.rows.size()) <= parameters.max_boxes_with_responses;
}

// Solve a convex problem of boxes for the forces minus the middles of their limits. The rows without forces are in end_rows.
bool StepForces::solve_boxes() {
    const int n = static_cast<int>(elements_.rows.size());
    box_rows_ = end_rows.head(n);
    centered_ = f.head(n);
    bounds_.resize(n);
    for (int i = 0; i < n; ++i) bounds_[i] = elements_.cones[i].bound;
    box_.solve(responses_.matrix(n), box_rows_, bounds_, &centered_, centered_);
    f.head(n) = centered_;
    error_ = 0.0;
    return true;
}

// Solve a problem with cones in the same way, or hold the bodies at rest.
bool StepForces::solve_cones(bool starts, const VecX& q0) {
    const int n = static_cast<int>(elements_.rows.size());
    const auto W = responses_.matrix(n);
    solver_.search_briefly(separate_ && error_ < parameters.max_brief_error);
    status_ = solver_.solve(W, end_rows.head(n), elements_.cones, true, f.head(n), true);
    error_ = solver_.error();
    const bool solved = status_ == ConeStatus::solved && !add_energy(W, end_rows.head(n), f.head(n));
    if (!starts || !keep_rest(solved, q0)) return solved;
    status_ = ConeStatus::solved;
    error_ = 0.0;
    return true;
}

// Hold the elements that rest at the step's start if forces can hold them, whatever moves elsewhere. With the responses of
// all rows, bodies are held only if the whole scene rests.
void StepForces::hold_resting(const VecX& q0) {
    rests_.clear();
    for (const StepElements::Part& part : elements_.parts)
        rests_.push_back((part.rests || part.element < 0) && !part.strikes);  // without friction, contact is rest
    if (!trees_.hold(rests_, middle_, f)) w.state.q_without_rest = q0;  // the next sweeps skip this check
    error_ = trees_.error();
}

// Accept the best forces found tree by tree, which violate the laws of contact by the error of one element.
bool StepForces::accept_best_forces(double h) {
    const BlockSolver::Miss& miss = trees_.miss();
    if (miss.element < 0) return false;
    f.head(best_f_.size()) = best_f_;
    const StepElements::Part& part = elements_.parts[miss.element];
    law_miss_ = {part.gap >= 0 ? p.gaps[part.gap].block : p.frictions[part.element].block, h * miss.velocity};
    return true;
}

std::vector<int> StepForces::contradicting_contacts() const {
    std::vector<int> blocks;
    if (status_ != ConeStatus::infeasible && status_ != ConeStatus::jammed) return blocks;
    const VecX& pushes = solver_.certificate();
    const double least = parameters.limit_rounding * pushes.cwiseAbs().maxCoeff();
    for (size_t e = 0, at = 0; e < elements_.parts.size(); at += elements_.cones[e++].dim)
        if (elements_.parts[e].gap >= 0 && pushes[at] > least) blocks.push_back(p.gaps[elements_.parts[e].gap].block);
    return blocks;
}

void StepForces::measure_end() {
    const int n = static_cast<int>(elements_.rows.size());
    if (separate_) return trees_.move(middle_, f, a_, end_rows);
    end_rows.head(n) = free_rows_.head(n);
    end_rows.head(n).noalias() += responses_.matrix(n) * f.head(n);
}

double StepForces::row_error(int at, int dim) const {
    if (dim == 0) return 0.0;
    return std::min(error_, parameters.max_residual) * free_rows_.segment(at, dim).cwiseAbs().maxCoeff();
}

double StepForces::rest_of_rows() const {
    const auto free = free_rows_.head(static_cast<Eigen::Index>(elements_.rows.size()));
    return parameters.rest_rounding * free.cwiseAbs().maxCoeff();
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
    if (!holds) w.state.q_without_rest = q0;  // the next sweeps skip this check
    return holds;
}

ConeResiduals StepForces::residuals() {
    if (!has_load_) return {};
    const int n = static_cast<int>(elements_.rows.size());
    if (separate_) return trees_.residuals(middle_, f);
    const auto W = responses_.matrix(n);
    end_rows.head(n) = free_rows_.head(n);
    end_rows.head(n).noalias() += W * middle_.head(n);
    centered_ = f.head(n) - middle_.head(n);
    return cone_residuals(W, end_rows.head(n), elements_.cones, centered_);
}

}  // namespace pn
