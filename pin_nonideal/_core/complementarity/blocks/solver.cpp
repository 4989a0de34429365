#include "complementarity/blocks/solver.hpp"

#include <algorithm>

namespace pn {

bool BlockSolver::pose() {
    if (!problem.factor()) return false;
    problem.normalize();
    newton_.pose(problem);
    islands_.find(problem);
    if (static_cast<int>(factors_.size()) < islands_.size()) factors_.resize(islands_.size());
    errors_.assign(islands_.size(), 0.0);
    w_.setZero(problem.rows);
    return true;
}

void BlockSolver::release(const VecX& free, const VecX& constant) {
    problem.free = free;
    problem.to_unknowns(problem.free);
    if (constant.size() > 0 && (constant.array() != 0.0).any()) {
        x_.setZero(free.size());
        for (const BlockElement& e : problem.elements) problem.push(e, constant, x_);
        for (size_t n = 0; n < problem.nodes.size(); ++n) problem.solve_mass(static_cast<int>(n), x_);
        problem.free += x_;
    }
    x_ = problem.free;
    free_rows_.resize(problem.rows);
    free_speed_ = 0.0;
    for (const BlockElement& e : problem.elements) problem.respond(e, x_, free_rows_);
    for (int r = 0; r < problem.rows; ++r) {
        free_rows_[r] += problem.offset[r];
        free_speed_ = std::max(free_speed_, std::abs(free_rows_[r]));
    }
}

void BlockSolver::motion(VecX& x) const {
    on_nodes_ = x_;
    problem.from_unknowns(on_nodes_);
    for (const BlockNode& node : problem.nodes)
        x.segment(node.first, node.size) = on_nodes_.segment(node.first, node.size);
}

double BlockSolver::newton(int island, BlockNewton::Search search, double compliance, VecX& f) {
    return newton_.solve(problem, islands_[island], factors_[island], search, compliance, f, x_, w_);
}

// Solve from forces f that are close to a solution, and keep the best forces so far. Return true if these solve the
// laws.
bool BlockSolver::attempt(int island, VecX& f) {
    const double error = newton(island, BlockNewton::Search::patient, 0.0, f);
    if (error < least_) {
        least_ = error;
        best_ = f;
    }
    return least_ <= parameters.tolerance;
}

// Follow the central path from no forces, and solve from its end. The path may end before the laws of friction hold.
// Paths with slip speeds of the same step and of the last step fail in different problems. Return true if f solves the
// laws.
bool BlockSolver::search_from_path(int island, BlockInteriorPoint::Slip slip, VecX& f) {
    if (steps() > last_step_) return false;
    path_.follow(problem, newton_, islands_[island], factors_[island], slip, f, x_, w_);
    if (newton_.project(problem, islands_[island], f)) newton_.move(problem, islands_[island], f, x_, w_);
    return attempt(island, f) || least_ <= parameters.near_tolerance;
}

// Alternate sweeps and Newton's method. Newton's method may cycle between sets of sliding elements, and sweeps break
// such a cycle.
bool BlockSolver::settle(int island, VecX& f) {
    swept_ = best_;
    for (int round = 0; round < parameters.max_sweep_rounds && steps() <= last_step_; ++round) {
        newton_.sweep(problem, islands_[island], parameters.sweeps_per_round, swept_, x_, w_);
        f = swept_;
        if (attempt(island, f) || least_ <= parameters.near_tolerance) return true;
    }
    return false;
}

// Solve an island with a small compliance of all elements, then without. Compliant elements share a load in one way. Return
// true if f solves the laws.
bool BlockSolver::share(int island, VecX& f) {
    const double error = newton(island, BlockNewton::Search::bold, parameters.shared_compliance, f);
    if (error > parameters.shared_tolerance) return false;
    least_ = newton_.solve_without_compliance(problem, islands_[island], factors_[island], f, x_, w_);
    return least_ <= parameters.tolerance;
}

void BlockSolver::clear(int island, VecX& f) const {
    for (int i : islands_[island].elements) f.segment(problem.elements[i].row, problem.elements[i].dim()).setZero();
}

// Copy the forces of an island.
void BlockSolver::copy(const Island& island, const VecX& from, VecX& to) const {
    for (int i : island.elements) {
        const BlockElement& e = problem.elements[i];
        to.segment(e.row, e.dim()) = from.segment(e.row, e.dim());
    }
}

// Check if a contact with a force in the guess has none in f.
bool BlockSolver::unloads(int island, const VecX& f) const {
    const auto& elements = islands_[island].elements;
    return std::any_of(elements.begin(), elements.end(), [&](int i) {
        const BlockElement& e = problem.elements[i];
        return e.head() && guess_[e.row] > 0.0 && f[e.row] == 0.0;
    });
}

// Check if the forces of an island add energy at its motion.
bool BlockSolver::adds_energy(int island, const VecX& f) {
    double conveyed = 0.0, free = 0.0, own = 0.0;
    for (int i : islands_[island].elements) {
        const BlockElement& e = problem.elements[i];
        for (int r = e.row; r < e.row + e.dim(); ++r) {
            conveyed += f[r] * (w_[r] - free_rows_[r]);
            free -= f[r] * free_rows_[r];
            own += f[r] * f[r] / newton_.stiffness(r);
        }
    }
    return add_energy(conveyed, free, own);
}

// Compute forces near a solution by sweeps from no forces, which bound the energy. Return their error.
double BlockSolver::sweep(int island, VecX& f) {
    clear(island, f);
    newton_.sweep(problem, islands_[island], parameters.last_sweeps, f, x_, w_);
    return newton_.error(problem, islands_[island], f, w_);
}

// Solve an island by Newton's method from the guess, else from the end of a central path, else after sweeps. Return the
// error. If a contact loses its load in one of several solutions, the solution with shared loads is preferred.
double BlockSolver::solve(int island, VecX& f) {
    const Island& on = islands_[island];
    const bool many = static_cast<int>(on.elements.size()) >= parameters.min_sharing, alone = many && on.nodes.size() == 1;
    if (alone) {
        least_ = newton_.error(problem, on, f, w_);
        if (least_ <= BlockNewton::parameters.tolerance || share(island, f)) return least_;
        copy(on, guess_, f);
        newton_.move(problem, on, f, x_, w_);
    }
    least_ = newton(island, BlockNewton::Search::bold, 0.0, f);
    if (least_ <= parameters.tolerance && many && !alone && unloads(island, f)) {
        const double error = least_;
        best_ = f;
        copy(on, guess_, f);
        newton_.move(problem, on, f, x_, w_);
        if (share(island, f)) return least_;
        f = best_;
        least_ = error;
        newton_.move(problem, on, f, x_, w_);
    }
    if (least_ <= parameters.tolerance) return least_;
    best_ = f;
    if (least_ <= parameters.near_tolerance) attempt(island, f);
    else if (!search_from_path(island, BlockInteriorPoint::Slip::follows, f) &&
             !search_from_path(island, BlockInteriorPoint::Slip::lags, f))
        settle(island, f);
    f = best_;
    newton_.move(problem, islands_[island], f, x_, w_);
    return least_;
}

void BlockSolver::begin(int island) {
    newton_.begin(problem, islands_[island], free_rows_);
    last_step_ = steps() + parameters.max_work / static_cast<int>(islands_[island].elements.size());
}

// Solve an island from the guess. If the forces are far from a solution or add energy, solve it from no forces, else by
// sweeps.
double BlockSolver::solve_within_energy(int island, VecX& f) {
    begin(island);
    for (int attempts = 0; attempts < 2; ++attempts) {
        newton_.move(problem, islands_[island], f, x_, w_);
        const double error = solve(island, f);
        if (error <= parameters.min_swept_error && !adds_energy(island, f)) return error;
        clear(island, guess_);
        clear(island, f);
    }
    return std::max(sweep(island, f), parameters.min_swept_error);
}

double BlockSolver::solve(VecX& f) {
    guess_ = f;
    error_ = 0.0;
    miss_ = {};
    for (int i = 0; i < islands_.size(); ++i) {
        errors_[i] = solve_within_energy(i, f);
        if (errors_[i] > error_) {
            error_ = errors_[i];
            newton_.worst(problem, islands_[i], f, w_, miss_.element, miss_.velocity);
        }
        if (newton_.project(problem, islands_[i], f)) newton_.move(problem, islands_[i], f, x_, w_);
    }
    return error_;
}

// Check if the elements that rest stay at rest, each in its own units and in those of an energy, in which a light body may
// be faster than a heavy one.
bool BlockSolver::rests(const Island& island) const {
    const double still = parameters.rest_speed * free_speed_;
    return newton_.speed(problem, island, w_, true) <= parameters.rest_speed &&
           std::all_of(island.elements.begin(), island.elements.end(), [&](int i) {
               const BlockElement& e = problem.elements[i];
               return !e.rests || w_.segment(e.row, e.dim()).norm() <= still;
           });
}

// Search for rest from the end of the convex problem's path. Compliant elements share the loads in one way.
bool BlockSolver::hold(int island, VecX& f) {
    const Island& on = islands_[island];
    path_.follow(problem, newton_, on, factors_[island], BlockInteriorPoint::Slip::none, f, x_, w_);
    if (!(newton_.speed(problem, on, w_, true) <= parameters.path_rest_speed)) return false;
    swept_ = f;
    if (share(island, f) && rests(on)) return true;
    copy(on, swept_, f);
    newton_.move(problem, on, f, x_, w_);
    return newton(island, BlockNewton::Search::bold, 0.0, f) <= parameters.tolerance && rests(on);
}

// Check if an island has elements that rest and no contact that moves. The convex problem does not state the law of a
// contact that slides.
bool BlockSolver::may_hold(const Island& island) const {
    bool rests = false;
    for (int i : island.elements) {
        const BlockElement& e = problem.elements[i];
        if (!e.rests && e.head() > 0) return false;
        rests |= e.rests;
    }
    return rests;
}

// Find the largest error of the islands, and the element that has it.
void BlockSolver::find_worst(const VecX& f) {
    error_ = 0.0;
    miss_ = {};
    for (int i = 0; i < islands_.size(); ++i) {
        if (!(errors_[i] > error_)) continue;
        error_ = errors_[i];
        begin(i);
        newton_.worst(problem, islands_[i], f, w_, miss_.element, miss_.velocity);
    }
}

bool BlockSolver::hold(VecX& f) {
    bool all = true, changes = false;
    guess_ = f;
    for (int i = 0; i < islands_.size(); ++i) {
        if (!may_hold(islands_[i])) continue;
        begin(i);
        if (rests(islands_[i])) continue;
        if (hold(i, f)) {
            errors_[i] = newton_.error(problem, islands_[i], f, w_);
            changes = true;
            continue;
        }
        copy(islands_[i], guess_, f);
        newton_.move(problem, islands_[i], f, x_, w_);
        all = false;
    }
    if (changes) find_worst(f);
    return all;
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
