#include "run/time_stepping/moreau.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/step_start.hpp"
#include "complementarity/socp_mode_newton.hpp"
#include "friction/stick_slip.hpp"
#include "math/decompositions.hpp"
#include "run/time_stepping/end_modes.hpp"
#include "tree/lie_group.hpp"

namespace pn {

namespace {

// Return all elements of a scene without unilateral contacts, else none. MoreauContacts treats other scenes.
std::vector<int> all_elements(const System& system) {
    std::vector<int> list(system.ng > 0 ? 0 : system.ne);
    std::iota(list.begin(), list.end(), 0);
    return list;
}

}  // namespace

Moreau::Moreau(System& system)
    : system_(system), p(system.p), w(system.w), problem_(p, all_elements(system)), modes_(system.ne, unloaded),
      unloaded_(modes_), mean_(p), drives_(p), flight_(p, drives_), q_mid_(VecX::Zero(system.nq)),
      power_(VecX::Zero(system.nw)), limit_(system.ne, problem_.rows),
      force_limit_(limit_) {
    problem_.alpha0 = alpha_ = initial_force_ = VecX::Zero(problem_.rows);
    for (int dim : problem_.dims) boxes_ = boxes_ && dim == 1;
    all_rows_.resize(problem_.rows);
    std::iota(all_rows_.begin(), all_rows_.end(), 0);
}

void Moreau::step(double t, double h, VecX& y, double& numerical_energy) {
    const Mechanism& m = p.mechanism;
    h_ = h;
    v0_ = system_.velocity(y);
    move_ = 0.5 * h * v0_;
    retract(m, y.data(), move_.data(), q_mid_.data());
    const double middle = t + 0.5 * h;
    t0_ = t;
    q0_ = y.head(system_.nq);
    holds_.clear();
    for (const Mode mode : w.state.mode) holds_.push_back(mode == sticking);
    set_modes(p, w, unloaded_);
    mean_.begin(h, v0_, w.state.last_rates);
    system_.read(y);
    system_.read_law_states(y);
    JointDrives::Step drives(drives_, p, w, t, h, system_.q, v0_);
    sweep(middle, drives, true);
    while (mean_.move(false)) sweep(middle, drives, p.has_user_rows);
    mean_.keep_rate(w.state.last_rates);
    flight_.move(p, w, h, y.data(), v0_, mean_.value(), v1_);
    if (system_.energy) {
        numerical_energy += drives.energy(mean_.start(), mean_.finish());
        book_work(y, numerical_energy);
    }
    set_modes(p, w, modes_);
    if (system_.nz > 0) y.segment(system_.nq + system_.nv, system_.nz) += h * w.now.dz;
    move_ = 0.5 * h * v1_;
    retract(m, q_mid_.data(), move_.data(), y.data());
    flight_.place(p, y.data());
    y.segment(system_.nq, system_.nv) = v1_;
}

// Solve the step with the forces at the mean velocity found so far. `anew`: the rows have changed.
void Moreau::sweep(double t, JointDrives::Step& drives, bool anew) {
    if (anew) begin_rows_inside(p, w, t0_, q0_, t, q_mid_, mean_.value());
    drives.move(mean_.start(), mean_.value());
    solve_without_friction(t);
    if (anew) respond();
    pose_problem();
    if (mean_.is_first()) find_rest();
    do solve_friction(t);
    while (give_way());
    end_velocity();
}

// Solve the motion without friction of the elements, with constraints satisfied at the step's end.
void Moreau::solve_without_friction(double t) {
    assemble_forces(p, w, t, mean_.value());
    solve_dynamics(p, w, t, mean_.value());
    a_free_ = w.now.a;
    lam_free_ = w.now.lam;
    if (w.now.rows.blocks.empty()) return;
    b_ = w.now.b;
    mean_.meet_at_end(p, w, b_);
    solve_motion(p, w, p.has_laws(), b_, a_free_, lam_free_);
}

void Moreau::respond() {
    problem_.respond_in_step(p, w);
    problem_.clean(p, w);
    find_dependent();
}

// Check if some forces of the elements do not move the bodies. Loads, and the limits by them, are then not unique.
void Moreau::find_dependent() {
    are_dependent_ = false;
    if (!p.needs_reactions || w.now.rows.blocks.empty()) return;
    are_dependent_ = SharedFriction::are_dependent(problem_.W, all_rows_);
}

// Set up the friction problem. Slip velocities at the step's end over h replace slip accelerations.
void Moreau::pose_problem() {
    problem_.along(p, w, a_free_, problem_.alpha0);
    int at = 0;
    for (const Friction& friction : p.frictions) {
        const Block& block = p.blocks[friction.block];
        mean_.start_rates(p, w, friction.block);
        for (int k = 0; k < friction.dim; ++k)
            problem_.alpha0[at++] += w.scratch.r[block.row + k] / h_ + 0.5 * w.now.values[friction.block].bias[k];
    }
    unload_held();
}

// Remove the slip that constraints prevent, of elements that no prescribed motion moves.
void Moreau::drop_prevented_slip() {
    std::vector<int> rows;
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e)
        for (int k = 0; k < problem_.dims[e]; ++k)
            if (!p.follows_drives(e) && problem_.W(at + k, at + k) > 0.0) rows.push_back(at + k);
    SharedFriction::drop_prevented_slip(problem_.W, rows, problem_.alpha0);
}

// Remove friction from elements that the constraints alone hold. The rounding of their slip has no sign.
void Moreau::unload_held() {
    if (problem_.W.diagonal().all()) return;
    const double rounding = mean_.held_slip(p, a_free_);
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e) {
        const int dim = problem_.dims[e];
        if (problem_.W.diagonal().segment(at, dim).any()) continue;
        if (problem_.alpha0.segment(at, dim).norm() > rounding) continue;
        problem_.alpha0.segment(at, dim).setZero();
        w.state.percussion.segment(p.blocks[p.frictions[e].block].row, dim).setZero();
    }
}

// Find the elements without slip at the step's start. Static friction may hold them.
void Moreau::find_rest() {
    for (int e = 0; e < system_.ne; ++e) holds_[e] = holds_[e] || mean_.starts_at_rest(p, w, p.frictions[e]);
}

// Replace static by kinetic friction where static friction does not hold. Return true if it does.
bool Moreau::give_way() {
    bool changes = false;
    alpha_ = problem_.alpha0;
    alpha_.noalias() += problem_.W * force_;
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e) {
        if (!holds_[e] || p.frictions[e].static_ratio == 1.0 || is_within_limit(e, at)) continue;
        if (alpha_.segment(at, problem_.dims[e]).norm() <= slip_rounding()) continue;
        holds_[e] = false;
        changes = true;
    }
    return changes;
}

// Check if the force of an element is below its limit. Its forces start at row `at`.
bool Moreau::is_within_limit(int e, int at) {
    const int dim = problem_.dims[e];
    shifted_ = force_.segment(at, dim);
    if (dim == 1) shifted_[0] -= force_limit_.middle[at];
    return shifted_.norm() < force_limit_[e] * (1.0 - parameters.limit_rounding);
}

// Rounding of slip accelerations.
double Moreau::slip_rounding() const {
    return parameters.slip_rest_rounding * problem_.alpha0.lpNorm<Eigen::Infinity>();
}

// Compute the motion under the friction forces.
void Moreau::apply_forces() {
    problem_.acceleration(p, w, force_, a_friction_);
    w.now.a = a_free_ + a_friction_;
    w.now.lam = lam_free_;
    w.now.lam.noalias() += problem_.multipliers * force_;
    for (int e = 0, at = 0; e < system_.ne; ++e) {
        Vec3& force = w.now.slip_force.change(e);
        force = Vec3::Zero();
        for (int k = 0; k < problem_.dims[e]; ++k) force[k] = force_[at++];
    }
    w.now.renew();
}

// Update the limits to the loads of the motion in the workspace. Return their largest change.
double Moreau::update_limits(double t) {
    double change = 0.0;
    symmetric_limits_ = true;
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e) {
        const Friction& friction = p.frictions[e];
        const SlipLimits load = load_limits(p, w, friction, t, w.now.terms.q, mean_.value());
        const double speed = slip_velocity(w.now, friction).norm();
        const SlipLimits limit = load * (holds_[e] ? friction.static_ratio : friction.speed_factor(speed));
        change = std::max({change, std::abs(limit.reach() - limit_[e]), std::abs(limit.middle() - limit_.middle[at])});
        limit_.size[e] = limit.reach();
        limit_.middle[at] = limit.middle();
        symmetric_limits_ = symmetric_limits_ && limit.middle() == 0.0;
    }
    return change;
}

// Compute the next iterate of the limits from two limits: one gave the force, the other follows from it.
void Moreau::accelerate_limits() {
    const Eigen::Index ne = system_.ne, rows = problem_.rows;
    VecX from(ne + rows), to(ne + rows);
    from << force_limit_.size, force_limit_.middle;
    to << limit_.size, limit_.middle;
    const VecX next = loads_.next(from, to);
    limit_.size = next.head(ne).cwiseMax(0.0);
    limit_.middle = next.tail(rows);
}

// Solve for the friction forces, with limits for the loads of this step.
void Moreau::solve_friction(double t) {
    int at = 0;  // warm start from forces of the last step, whose modes usually persist
    for (const Friction& friction : p.frictions)
        for (int k = 0; k < friction.dim; ++k)
            initial_force_[at++] = w.state.percussion[p.blocks[friction.block].row + k];
    if (find_forces(t)) return;
    if (!are_dependent_) throw Failure(Failure::Kind::not_converged, t, problem_.elements);
    drop_prevented_slip();  // friction may grow against it without end
    if (!find_forces(t)) throw Failure(Failure::Kind::not_converged, t, problem_.elements);
}

// Alternate between the forces and the limits by their loads. Return false if this does not converge.
bool Moreau::find_forces(double t) {
    force_.setZero(problem_.rows);
    double last_change = HUGE_VAL;
    loads_.restart();
    for (int pass = 0; pass < parameters.max_load_passes; ++pass) {
        // Limits that depend on no load need no motion.
        if (pass == 0 || p.needs_reactions) apply_forces();
        const double change = update_limits(t);
        const double largest = system_.ne > 0 ? std::max(0.0, limit_.size.maxCoeff()) : 0.0;
        const bool stalls = change > parameters.min_load_decrease * last_change &&
                            change <= parameters.stall_load_tolerance * largest;
        last_change = change;
        if (pass > 0 && (change <= parameters.load_tolerance * largest || stalls || !p.needs_reactions)) return true;
        if (pass > 0) accelerate_limits();
        if (!symmetric_limits_) force_ = friction_program(problem_.W, problem_.alpha0, problem_.dims, limit_);
        else if (problem_.rows > 0 && boxes_)
            box_.solve(problem_.W, problem_.alpha0, limit_.size, &initial_force_, force_);
        else force_ = friction_program(problem_.W, problem_.alpha0, problem_.dims, limit_.size, &initial_force_);
        force_limit_ = limit_;
        if (are_dependent_) share_loads();
        initial_force_ = force_;
    }
    return false;
}

// Replace the forces of elements that stick by the forces of least norm with the same motion.
void Moreau::share_loads() {
    alpha_ = problem_.alpha0;
    alpha_.noalias() += problem_.W * force_;
    std::vector<SharedFriction::Element> sticking;
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e) {
        const int dim = problem_.dims[e];
        const bool sticks = is_within_limit(e, at) || alpha_.segment(at, dim).norm() <= slip_rounding();
        if (sticks && force_limit_[e] > 0.0) sticking.push_back({at, dim, force_limit_[e], force_limit_.middle[at]});
    }
    shared_.share(problem_.W, sticking, force_);
}

// Compute the velocity and the modes at the step's end. A force below its limit holds its element.
void Moreau::end_velocity() {
    alpha_ = problem_.alpha0;
    alpha_.noalias() += problem_.W * force_;
    problem_.acceleration(p, w, force_, a_friction_);
    a_friction_ += a_free_;
    mean_.end(a_friction_, v1_);
    const EndModes end(v1_);
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e) {
        const int dim = problem_.dims[e];
        w.state.percussion.segment(p.blocks[p.frictions[e].block].row, dim) = force_.segment(at, dim);
        const double slip = alpha_.segment(at, dim).norm();
        const bool sticks = is_within_limit(e, at) || (end.is_rest(h_ * slip) && slip <= slip_rounding());
        modes_[e] = EndModes::settle(sticks, dim > 1 || alpha_[at] > 0.0, p.blocks[p.frictions[e].block], v1_);
    }
}

// Add the work over the step, by the mean velocity. If a slip reverses inside the step, friction opposes the slip at
// the step's end and can do positive work on the mean velocity. This work is due to the scheme, not to friction.
void Moreau::book_work(VecX& y, double& numerical_energy) {
    w.now.lam = lam_free_;
    w.now.lam.noalias() += problem_.multipliers * force_;
    move_ = 0.5 * (mean_.start() + mean_.finish());
    powers(p, w, move_, power_.data());  // powers of all forces but dry friction, whose modes are not set yet
    problem_.along(p, w, move_, alpha_);
    for (int e = 0, at = 0; e < system_.ne; at += problem_.dims[e], ++e) {
        double& power = power_[first_law_power + p.frictions[e].law];
        power += alpha_.segment(at, problem_.dims[e]).dot(force_.segment(at, problem_.dims[e]));
        if (!(power > 0.0)) continue;
        numerical_energy += h_ * power;
        power = 0.0;
    }
    system_.work(y) += h_ * power_;
}

}  // namespace pn
