#include "complementarity/blocks/solver.hpp"

#include <algorithm>

namespace pn {

bool BlockSolver::pose() {
    if (!problem.factor()) return false;
    newton_.pose(problem);
    islands_.find(problem);
    if (static_cast<int>(factors_.size()) < islands_.size()) factors_.resize(islands_.size());
    x_ = problem.free;
    w_.setZero(problem.rows);
    free_speed_ = 0.0;
    for (const BlockElement& e : problem.elements) {
        problem.respond(e, x_, w_);
        for (int r = e.row; r < e.row + e.dim(); ++r)
            free_speed_ = std::max(free_speed_, std::abs(w_[r] + problem.offset[r]));
    }
    return true;
}

double BlockSolver::newton(int island, BlockNewton::Search search, double compliance, VecX& f) {
    return newton_.solve(problem, islands_[island], factors_[island], search, compliance, f, x_, w_);
}

// Solve from forces that are close to a solution, which f becomes. Return true if it is one.
bool BlockSolver::attempt(int island, VecX& f) {
    const double error = newton(island, BlockNewton::Search::patient, 0.0, f);
    if (error < least_) {
        least_ = error;
        best_ = f;
    }
    return least_ <= parameters.accepted;
}

// Reduce a compliance of all elements to zero, from no forces. Each problem on the way has a solution close to that of
// the last one, so the path ends at one solution of several.
bool BlockSolver::stiffen(int island, VecX& f) {
    for (int i : islands_[island].elements) f.segment(problem.elements[i].row, problem.elements[i].dim()).setZero();
    on_path_ = f;
    double compliance = parameters.first_compliance, factor = parameters.first_factor;
    for (int stage = 0; stage < parameters.most_stages && compliance > parameters.min_compliance; ++stage) {
        f = on_path_;
        const auto search = stage == 0 ? BlockNewton::Search::patient : BlockNewton::Search::bold;
        if (newton(island, search, compliance, f) <= parameters.compliance_path_tolerance) {
            on_path_ = f;
            if (compliance <= parameters.attempted_from && attempt(island, f)) return true;
            compliance *= factor;
        } else {  // a shorter step from the last compliance
            if (stage == 0) return false;
            compliance /= factor;
            factor = std::sqrt(factor);
            if (factor > parameters.last_factor) return false;
            compliance *= factor;
        }
    }
    return false;
}

// Alternate sweeps and Newton's method. Newton's method may cycle between sets of sliding elements, which sweeps leave.
bool BlockSolver::settle(int island, VecX& f) {
    on_path_ = best_;
    for (int round = 0; round < parameters.most_sweep_rounds; ++round) {
        newton_.sweep(problem, islands_[island], parameters.sweeps_a_round, on_path_, x_, w_);
        f = on_path_;
        if (attempt(island, f) || least_ <= parameters.tolerated) return true;
    }
    return false;
}

// Solve an island by Newton's method from the guess, else after sweeps, else along the path of compliances. Return the
// error.
double BlockSolver::solve(int island, VecX& f) {
    least_ = newton(island, BlockNewton::Search::bold, 0.0, f);
    if (least_ <= parameters.accepted) return least_;
    best_ = f;
    if (!attempt(island, f) && least_ > parameters.tolerated && !settle(island, f)) stiffen(island, f);
    f = best_;
    newton_.move(problem, islands_[island], f, x_, w_);
    return least_;
}

double BlockSolver::solve(VecX& f) {
    error_ = 0.0;
    miss_ = {};
    for (int i = 0; i < islands_.size(); ++i) {
        const double error = solve(i, f);
        if (error > error_) {
            error_ = error;
            newton_.worst(problem, islands_[i], f, w_, miss_.element, miss_.velocity);
        }
        if (newton_.project(problem, islands_[i], f)) newton_.move(problem, islands_[i], f, x_, w_);
    }
    return error_;
}

void BlockSolver::move(const VecX& f) {
    for (int i = 0; i < islands_.size(); ++i) newton_.move(problem, islands_[i], f, x_, w_);
}

ConeResiduals BlockSolver::residuals(const VecX& f) const {
    ConeResiduals out;
    double force = 0.0;
    for (int r = 0; r < problem.rows; ++r) force = std::max(force, std::abs(f[r]));
    for (const BlockElement& e : problem.elements) {
        double speed = free_speed_;
        for (int r = e.row; r < e.row + e.dim(); ++r) speed = std::max(speed, std::abs(f[r]) / newton_.stiffness(r));
        add_residuals(e.cone, f.data() + e.row, w_.data() + e.row, force, speed, out);
    }
    return out;
}

}  // namespace pn
