#include "run/time_stepping/moreau_contacts.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "contact/impact.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/step_start.hpp"
#include "friction/stick_slip.hpp"
#include "run/time_stepping/moreau.hpp"
#include "tree/lie_group.hpp"
#include "tree/terms.hpp"
#include "math/tolerances.hpp"

namespace pn {

namespace {

constexpr double cone_force_rounding = 1e-9;  // distance of a force at its limit, relative to the limit
constexpr double most_stopped = 1e-6;  // slip of an element that stops, relative to 1 + the largest velocity
constexpr double width_rounding = 1e-12;  // uncertainty of a gap at rest, relative to the scene's size
// Accepted residual relative to the velocities. A step of a turning body can have no exact solution if corners share
// its load. Also the accepted error of a limit, relative to the forces. The statistics report both.
constexpr double most_miss = 1e-7;
// Largest error of the laws that a step may have, relative to an element's forces, if no forces meet them. An event
// reports it.
constexpr double most_relaxed = 1e-2;

}  // namespace

MoreauContacts::MoreauContacts(System& system, GapWatch& watch)
    : system_(system), p(system.p), w(system.w), mean_(p), drives_(p), flight_(p, drives_), watch_(watch),
      elements_(p), was_closed_(system.ng, 0), closed_(system.ng, 0), open_(system.ng, 0), modes_(system.ne, unloaded),
      unloaded_(modes_), q_mid_(VecX::Zero(system.nq)), v0_(VecX::Zero(system.nv)), v1_(v0_), a_free_(v0_),
      power_(VecX::Zero(system.nw)), trees_(system.p), projection_(system.p), responses_(system.p), force_(v0_) {
    projection_.energy = system.energy;
    if (system.ng == 0) return;
    solver_.take_misses(most_miss);
    for (const Gap& gap : p.gaps) rounded_by_.push_back(rounded_by(p.blocks[gap.block].kind));
    rounded_ = std::any_of(rounded_by_.begin(), rounded_by_.end(), [](double r) { return r < HUGE_VAL; });
    lam_free_ = VecX::Zero(p.layout.rows);
    w0_ = w1_ = f_ = offset_ = middle_ = lam_free_;
    touching_.reserve(system.ng);
}

double MoreauContacts::allowed(double t, double h, const VecX& y) {
    if (!rounded_) return h;
    bool placed = false;
    double shortest = h;
    for (int i : watch_.gaps.near_gaps) {
        if (!(rounded_by_[i] < HUGE_VAL) || w.state.closed[i] || watch_.stays_open_in_step(i)) continue;
        if (!placed) {
            system_.read(y);
            kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
            placed = true;
        }
        follow_gap(p, w, t, system_.v, i);
        const double width = gap_width(p, w, i), rate = gap_rate(p, w, i);
        if (!(rate < 0.0) || !tells_way_out(i, width)) continue;
        const double reach = std::max(width, 0.0) + (width > 0.0 ? 0.5 : 1.0) * depth_left(p, w, i, width);
        shortest = std::min(shortest, reach / -rate);
    }
    return shortest;
}

void MoreauContacts::step(double t, double h, VecX& y, double& numerical_energy, double& impact_energy) {
    const Mechanism& m = p.mechanism;
    h_ = h;
    v0_ = system_.velocity(y);
    force_ = 0.5 * h * v0_;
    retract(m, y.data(), force_.data(), q_mid_.data());
    const double middle = t + 0.5 * h;
    const bool watched = system_.watches();
    if (watched || had_contacts_) {
        std::copy(w.state.mode.begin(), w.state.mode.end(), modes_.begin());
        was_closed_ = w.state.closed;
    }
    had_contacts_ |= watched;
    law_miss_ = {};
    if (watch_.gaps.current || q_sampled_.size() == 0) {
        q_sampled_ = y.head(system_.nq);
        watch_.begin_time_steps(width_rounding * scene_size(p, w));
    }
    t0_ = t;
    q0_ = y.head(system_.nq);
    select(open_, unloaded_, true);
    mean_.begin(h, v0_);
    system_.read(y);
    JointDrives::Step drives(drives_, p, w, t, h, system_.q, v0_);
    sweep(middle, drives, true);
    while (mean_.move() && correct(middle, drives)) {}
    flight_.begin();
    for (const StepRow& row : elements_.rows) flight_.touch(p.blocks[row.block]);
    flight_.move(p, w, h, y.data(), v0_, mean_.value(), v1_);
    if (system_.energy) {
        numerical_energy += drives.energy(mean_.start(), mean_.finish());
        book_work(y, numerical_energy, impact_energy);
    }
    select(closed_, modes_, elements_.rows.empty());
    had_contacts_ = watched || !elements_.rows.empty();
    if (system_.nz > 0) y.segment(system_.nq + system_.nv, system_.nz) += h * w.now.dz;
    force_ = 0.5 * h * v1_;
    retract(m, q_mid_.data(), force_.data(), y.data());
    flight_.place(p, y.data());
    y.segment(system_.nq, system_.nv) = v1_;
}

bool MoreauContacts::project(double t, VecX& y, double& numerical_energy) {
    if (!separate_) return false;
    const bool rests = (v0_.array() == 0.0).all() && (v1_.array() == 0.0).all() && same_bytes(closed_, was_closed_);
    if (rests || (w.now.touching.empty() && w.now.loaded.empty())) return true;
    system_.read(y);
    if (!projection_.project(p, w, t, system_.q, system_.v)) return false;
    system_.write(y);
    numerical_energy += projection_.numerical_energy();
    return true;
}

// Solve the step with the forces at the mean velocity found so far.
void MoreauContacts::sweep(double t, JointDrives::Step& drives, bool first) {
    if (first || p.has_user_rows) begin_rows_inside(p, w, t0_, q0_, t, q_mid_, mean_.value());
    drives.move(mean_.start(), mean_.value());
    solve_free(t);
    if (first) {
        find_touching(t);
        elements_.gather(p, w, touching_, modes_, v0_);
    } else {
        move_touching(t);
    }
    measure_free();
    if (first || p.has_user_rows) {
        responses_.forget();
        separate_ = !elements_.limits_follow_loads(p) &&
                    trees_.pose(p, w, elements_.rows, elements_.cones, a_free_, offset_);
    } else if (separate_) {
        trees_.release(a_free_, offset_);
    }
    if (!separate_) responses_.find(p, w, elements_.rows);
    recall_forces();
    solve(t);
    end_velocity();
}

// Solve the step again with the forces at the mean velocity. If no motion is found, return false with that of the first
// sweep.
bool MoreauContacts::correct(double t, JointDrives::Step& drives) {
    try {
        sweep(t, drives, false);
        return true;
    } catch (const Failure& failure) {
        if (failure.kind != Failure::Kind::not_converged) throw;
        mean_.begin(h_, v0_);
        sweep(t, drives, false);
        return false;
    }
}

// Set contacts and modes, with their rows. During most of a flight nothing changes. `flies`: no contact is closed and
// no element active in the new modes.
void MoreauContacts::select(const std::vector<char>& closed, const std::vector<Mode>& modes, bool flies) {
    if (flies && !system_.watches() && !w.now.rows.redundant && !w.now.rows.orthogonal) w.now.renew();
    else set_contacts(p, w, closed, modes);
}

// Solve the motion without contacts and dry friction, with constraints satisfied at the step's end.
void MoreauContacts::solve_free(double t) {
    assemble_forces(p, w, t, mean_.value());
    solve_dynamics(p, w, t, mean_.value());
    a_free_ = w.now.a;
    if (w.now.rows.blocks.empty()) {
        w.now.rows.distance = 1.0;
        return;
    }
    b_ = w.now.b;
    mean_.meet_at_end(p, w, b_);
    lam_free_ = w.now.lam;
    solve_motion(p, w, p.has_laws(), b_, a_free_, lam_free_);
}

// Return the travel of each dof since the last sample of the gaps, including projections. It is at least that of the
// velocity, because angles wrap around.
const VecX& MoreauContacts::way_since_last() {
    q_sampled_ -= q_mid_;
    ambient_to_tangent(p.mechanism, q_mid_.data(), q_sampled_.data(), v1_.data());
    force_ = v1_.cwiseAbs().cwiseMax(h_ * v0_.cwiseAbs());
    q_sampled_ = q_mid_;
    return force_;
}

// Find the contacts whose gap is closed at the step's middle, and contacts that were closed before. Their loads decide
// if they stay closed.
void MoreauContacts::find_touching(double t) {
    touching_.clear();
    for (int i : watch_.come(way_since_last())) {
        measure_gap(p, w, t, mean_.value(), i);
        const double width = gap_width(p, w, i);
        const bool touches = was_closed_[i] || (width <= 0.0 && tells_way_out(i, width));
        if (touches) touching_.push_back(i);
        watch_.gaps.width[i] = touches ? 0.0 : width - width_rounding * scene_size(p, w);  // guaranteed width
    }
    watch_.leave_far();
    for (int i : touching_) {
        evaluate_block(p, w, t, mean_.value(), p.gaps[i].block);
        for (int e : p.gaps[i].elements) evaluate_block(p, w, t, mean_.value(), p.frictions[e].block);
    }
    if (touching_.size() > 1)
        leave_one_of_each_place(p, w, touching_, [&](int i, int other) { return was_closed_[i] && !was_closed_[other]; });
}

// Evaluate the contacts that take part at a new mean velocity.
void MoreauContacts::move_touching(double t) {
    for (int i : touching_) {
        move_block(p, w, t, mean_.value(), p.gaps[i].block);
        for (int e : p.gaps[i].elements) move_block(p, w, t, mean_.value(), p.frictions[e].block);
    }
    elements_.move(p, w);
}

// Compute the velocities at the step's end without the forces, over h.
void MoreauContacts::measure_free() {
    const auto& rows = elements_.rows;
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(rows.size());
    for (int i = 0; i < n; ++i) {
        const Block& block = p.blocks[rows[i].block];
        if (i == 0 || rows[i].block != rows[i - 1].block) mean_.start_rates(p, w, rows[i].block);
        const double drift = w.now.values[rows[i].block].drift[block.kept[rows[i].k]];
        offset_[i] = w.scratch.r[block.row + rows[i].k] / h_ + 0.5 * drift;
    }
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e)
        offset_[at] += parts[e].approach / h_;
    for (int i = 0; i < n; ++i) {
        const Block& block = p.blocks[rows[i].block];
        if (i == 0 || rows[i].block != rows[i - 1].block) multiply(block, w.now.A, a_free_, w.scratch.r);
        w0_[i] = offset_[i] + w.scratch.r[block.row + rows[i].k];
    }
}

// Guess the forces of the last step.
void MoreauContacts::recall_forces() {
    for (size_t i = 0; i < elements_.rows.size(); ++i) {
        const StepRow& row = elements_.rows[i];
        f_[i] = w.state.percussion[p.blocks[row.block].row + row.k];
    }
}

// Compute the motion under the forces f.
void MoreauContacts::apply() {
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(elements_.rows.size());
    w.now.a = a_free_;
    w.now.renew();
    if (n == 0) return;
    if (separate_) {
        trees_.move(f_, w.now.a, w1_);
    } else {
        responses_.add_motion(p, w, f_, n, w.now.a);
    }
    if (w.now.rows.blocks.empty()) w.now.lam.setZero();
    else {
        w.now.lam = lam_free_;
        responses_.add_multipliers(f_, n, w.now.lam);
    }
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        const int head = parts[e].gap >= 0;
        if (head) w.now.lam[p.blocks[p.gaps[parts[e].gap].block].row] = f_[at];
        if (parts[e].element < 0) continue;
        Vec3& force = w.now.slip_force[parts[e].element];
        force = Vec3::Zero();
        for (int k = head; k < cones[e].dim; ++k) force[k - head] = f_[at + k];
    }
}

// Solve the laws tree by tree if possible, else with the responses of all rows.
bool MoreauContacts::solve_laws() {
    const int n = static_cast<int>(elements_.rows.size());
    elements_.middles(middle_);
    guess_ = f_.head(n);
    const double error = separate_ ? trees_.solve(elements_.cones, middle_, f_) : HUGE_VAL;
    bool solved = error <= most_miss;
    const bool starts = v0_.cwiseAbs().maxCoeff() <= rest_speed && !(q_without_rest_.size() > 0 && q_without_rest_ == q0_);
    if (solved && !(starts && moves())) return true;
    responses_.find(p, w, elements_.rows);
    if (!solved) {
        relaxed_f_ = f_.head(n);
        f_.head(n) = guess_;
    }
    const auto W = responses_.matrix(n);
    f_.head(n) -= middle_.head(n);
    w1_.head(n) = w0_.head(n);
    w1_.head(n).noalias() += W * middle_.head(n);
    solver_.search_briefly(error <= most_relaxed);
    if (!solved) solved = solver_.solve(W, w1_.head(n), elements_.cones, true, f_.head(n), true) == ConeStatus::solved;
    if (starts) solved = keep_rest(solved) || solved;
    f_.head(n) += middle_.head(n);
    if (!solved && error <= most_relaxed) {
        f_.head(n) = relaxed_f_;
        relax();
        return true;
    }
    return solved;
}

// Accept the best forces found, although they miss the laws of contact.
void MoreauContacts::relax() {
    const BlockSolver::Miss& miss = trees_.miss();
    const StepElements::Part& part = elements_.parts[miss.element];
    law_miss_ = {part.gap >= 0 ? p.gaps[part.gap].block : p.frictions[part.element].block, h_ * miss.velocity};
}

// Compute the rows under the forces f.
void MoreauContacts::measure_end() {
    const int n = static_cast<int>(elements_.rows.size());
    if (separate_) return trees_.move(f_, v1_, w1_);
    w1_.head(n) = w0_.head(n);
    w1_.head(n).noalias() += responses_.matrix(n) * f_.head(n);
}

bool MoreauContacts::moves() {
    const int n = static_cast<int>(elements_.rows.size());
    measure_end();
    if (separate_) return !trees_.rests(v1_);
    return w1_.head(n).cwiseAbs().maxCoeff() > cone_force_rounding * w0_.head(n).cwiseAbs().maxCoeff();
}

// Rest goes on if forces within all cones hold it. Returns whether they do, with these forces in place of others. The
// rows without forces are in w1.
bool MoreauContacts::keep_rest(bool solved) {
    const int n = static_cast<int>(elements_.rows.size());
    const auto W = responses_.matrix(n);
    const bool moves = (w1_.head(n) + W * f_.head(n)).cwiseAbs().maxCoeff() >
                       cone_force_rounding * w1_.head(n).cwiseAbs().maxCoeff();
    if (solved && !moves) return false;
    const bool holds = solver_.hold(W, w1_.head(n), elements_.cones, f_.head(n));
    if (!holds) q_without_rest_ = q0_;  // the next sweeps and the step after the start need not ask again
    return holds;
}

// Elements at rest can share loads in many ways, so that limits which follow the loads need not converge. Solve the step
// with a part of these limits. Return true if all elements rest and their forces are within the limits that follow.
bool MoreauContacts::rest_within_limits(double t) {
    elements_.reduce_limits();
    if (!solve_laws()) return false;
    apply();
    measure_end();
    const int n = static_cast<int>(elements_.rows.size());
    const bool stops = h_ * w1_.head(n).cwiseAbs().maxCoeff() <= most_stopped * (1.0 + v0_.cwiseAbs().maxCoeff());
    return stops && elements_.limits_hold(p, w, t, mean_, f_);
}

void MoreauContacts::solve(double t) {
    const int n = static_cast<int>(elements_.rows.size());
    const bool loads = n > 0 && elements_.cones.back().is(ConeElement::Kind::box);  // limits that may depend on the motion
    elements_.begin_passes();
    for (int pass = 0; n > 0; ++pass) {
        if (loads || pass > 0) apply();
        const double allowed = most_miss * f_.head(n).cwiseAbs().maxCoeff();
        if (elements_.limits_settle(p, w, t, mean_, allowed) && pass > 0) break;
        if (pass == max_load_passes && rest_within_limits(t)) break;
        if (pass == max_load_passes || !solve_laws()) throw Failure(Failure::Kind::not_converged, t);
        ++w.counters.iterations;
    }
    if (n == 0) apply();
    if (has_percussions_ || n > 0) w.state.percussion.setZero();
    has_percussions_ = n > 0;
    for (int i = 0; i < n; ++i) w.state.percussion[p.blocks[elements_.rows[i].block].row + elements_.rows[i].k] = f_[i];
    if (n == 0) return;
    const ConeResiduals r = residuals();
    w.counters.signorini = std::max(w.counters.signorini, r.signorini);
    w.counters.coulomb = std::max(w.counters.coulomb, r.coulomb);
    w.counters.dissipation = std::max(w.counters.dissipation, r.dissipation);
}

ConeResiduals MoreauContacts::residuals() {
    const int n = static_cast<int>(elements_.rows.size());
    if (separate_) return trees_.residuals(middle_, f_);
    const auto W = responses_.matrix(n);
    w1_.head(n) = w0_.head(n);
    w1_.head(n).noalias() += W * middle_.head(n);
    return ConeComplementarity::residuals(W, w1_.head(n), elements_.cones, f_.head(n) - middle_.head(n));
}

// Compute the velocity, the closed contacts and the modes at the step's end. An element sticks if its force stays below
// its limit, or if its slip is zero. If a solution meets neither condition, the one with the smaller miss holds.
void MoreauContacts::end_velocity() {
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(elements_.rows.size());
    if (n > 0) measure_end();
    mean_.end(w.now.a, v1_);
    if (had_contacts_) {
        std::fill(closed_.begin(), closed_.end(), char(0));
        std::fill(modes_.begin(), modes_.end(), unloaded);
    }
    if (n == 0) return;
    const double still = rest_rate(v1_), fastest = 1.0 + v1_.cwiseAbs().maxCoeff();
    const double clear = cone_force_rounding * f_.head(n).cwiseAbs().maxCoeff();
    w1_.head(n) *= h_;
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        const StepElements::Part& part = parts[e];
        const int head = part.gap >= 0, dim = cones[e].dim - head;
        if (head) closed_[part.gap] = w1_[at] - part.approach <= still;
        if (part.element < 0 || (head && !closed_[part.gap])) continue;
        const double limit = cones[e].bound * (head ? f_[at] : 1.0);
        const double size = dim == 1 ? std::abs(f_[at + head] - part.middle) : f_.segment(at + head, dim).norm();
        const double slip = w1_.segment(at + head, dim).norm();
        const bool stops = slip <= most_stopped * fastest || slip * limit <= (limit - size) * fastest;
        const bool sticks = (limit - size > clear && stops) || slip <= still;
        const bool forward = dim > 1 || (dim > 0 && w1_[at + head] > 0.0);
        modes_[part.element] = sticks && dim > 0 ? sticking : forward ? slip_plus : slip_minus;
        const Block& block = p.blocks[p.frictions[part.element].block];
        if (sticks && block.dof >= 0) v1_.segment(block.dof, block.total).setZero();
    }
    if (separate_) trees_.keep_rest(h_, v0_, v1_);
    const auto rest = [&](int e) {  // elements held by the constraints stick
        if (modes_[e] == unloaded && (p.frictions[e].gap < 0 || closed_[p.frictions[e].gap])) modes_[e] = sticking;
    };
    for (int e : elements_.outside_contacts()) rest(e);
    for (int i : touching_)
        for (int e : p.gaps[i].elements) rest(e);
    had_contacts_ = true;
}

// Add the work as Moreau::book_work does. The work of contacts along their normals belongs to impacts.
void MoreauContacts::book_work(VecX& y, double& numerical_energy, double& impact_energy) {
    const auto& rows = elements_.rows;
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(rows.size());
    if (!w.now.rows.blocks.empty()) {
        w.now.lam = lam_free_;
        responses_.add_multipliers(f_, n, w.now.lam);
    }
    force_ = 0.5 * (mean_.start() + mean_.finish());
    powers(p, w, force_, power_.data());
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        double power = 0.0;
        for (int k = 0; k < cones[e].dim; ++k) {
            const StepRow& row = rows[at + k];
            multiply(p.blocks[row.block], w.now.A, force_, w.scratch.r);
            const double part = w.scratch.r[p.blocks[row.block].row + row.k] * f_[at + k];
            if (k == 0 && parts[e].gap >= 0) impact_energy += h_ * part;
            else power += part;
        }
        if (parts[e].element < 0) continue;
        if (power > 0.0) numerical_energy += h_ * power;
        else power_[first_law_power + p.frictions[parts[e].element].law] += power;
    }
    system_.work(y) += h_ * power_;
}

}  // namespace pn
