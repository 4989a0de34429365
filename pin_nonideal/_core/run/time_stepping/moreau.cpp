#include "run/time_stepping/moreau.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/power.hpp"
#include "dynamics/projection.hpp"
#include "dynamics/acceleration.hpp"
#include "dynamics/step_start.hpp"
#include "friction/stick_slip.hpp"
#include "run/time_stepping/end_modes.hpp"
#include "tree/lie_group.hpp"
#include "tree/terms.hpp"

namespace pn {

Moreau::Moreau(System& system, GapWatch& watch, const ApproachingEdges& edges)
    : system_(system), p(system.p), w(system.w), mean_(p), drives_(p), flight_(p, drives_), opposed_(p), watch_(watch),
      edges_(edges), elements_(p), forces_(p, w, elements_), was_closed_(system.ng, 0), closed_(system.ng, 0),
      open_(system.ng, 0), modes_(system.ne, unloaded), unloaded_(modes_), q_mid_(VecX::Zero(system.nq)),
      v0_(VecX::Zero(system.nv)), v1_(v0_), a_free_(v0_), power_(VecX::Zero(system.nw)), projection_(system.p),
      tangent_(v0_) {
    projection_.energy = system.energy;
    lam_free_ = VecX::Zero(p.layout.rows);
    touching_.reserve(system.ng);
}

void Moreau::step(double t, double h, VecX& y, double& numerical_energy, double& impact_energy) {
    const Mechanism& m = p.mechanism;
    h_ = h;
    v0_ = system_.velocity(y);
    tangent_ = 0.5 * h * v0_;
    retract(m, y.data(), tangent_.data(), q_mid_.data());
    const double middle = t + 0.5 * h;
    const bool watched = system_.watches();
    if (watched || had_contacts_) {
        std::copy(w.state.mode.begin(), w.state.mode.end(), modes_.begin());
        was_closed_ = w.state.closed;
    }
    had_contacts_ |= watched;
    forces_.clear_miss();
    if (watch_.gaps.current || q_sampled_.size() == 0) {
        q_sampled_ = y.head(system_.nq);
        has_unknown_percussions_ = true;
        watch_.begin_time_steps(parameters.width_rounding * scene_size(p, w));
    }
    if (!std::exchange(repeats_, false)) find_loaded();
    t0_ = t;
    q0_ = y.head(system_.nq);
    select(open_, unloaded_, true);
    mean_.begin(h, v0_, w.state.last_rates);
    system_.read(y);
    system_.read_law_states(y);
    JointDrives::Step drives(drives_, p, w, t, h, system_.q, v0_);
    begin_sweeps(middle, drives);
    while (mean_.move(!touching_.empty()) && correct(middle, drives)) {}
    mean_.keep_rate(w.state.last_rates);
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
    tangent_ = 0.5 * h * v1_;
    retract(m, q_mid_.data(), tangent_.data(), y.data());
    flight_.place(p, y.data());
    y.segment(system_.nq, system_.nv) = v1_;
}

bool Moreau::project(double t, VecX& y, double& numerical_energy) {
    if (!forces_.is_separate()) {
        open_departing_contacts(t, y);
        return false;
    }
    const bool rests = (v0_.array() == 0.0).all() && (v1_.array() == 0.0).all() && same_bytes(closed_, was_closed_);
    const bool is_free = rests || (w.now.closed_gaps.empty() && w.now.loaded_elements.empty());
    if (is_free && !projection_.has_prescribed()) return true;
    system_.read(y);
    if (!projection_.project(p, w, t, h_, watch_.gaps.monitored_gaps, system_.q, system_.v)) return false;
    system_.write(y);
    numerical_energy += projection_.numerical_energy();
    return true;
}

// As ContactProjection::open_departing_contacts, with the responses of the step under the constraints.
void Moreau::open_departing_contacts(double t, const VecX& y) {
    if (w.now.closed_gaps.empty()) return;
    system_.read(y);
    kinematics(p.mechanism, w.now.terms, system_.q, system_.v);
    const ContactRounding rounding(p, w, system_.v);
    bool opens = false;
    for (size_t e = 0, at = 0; e < elements_.parts.size(); at += elements_.cones[e++].dim) {
        const int gap = elements_.parts[e].gap;
        if (gap < 0 || !closed_[gap]) continue;
        follow_gap(p, w, t, system_.v, gap);
        const double rate = gap_rate(p, w, gap);
        if (!(rate > rounding.rate && gap_width(p, w, gap) > rounding.gap)) continue;
        if (!ContactProjection::departs(rate, h_ * forces_.f[at], forces_.response(static_cast<int>(at)))) continue;
        closed_[gap] = 0;
        opens = true;
    }
    if (opens) set_closed(p, w, closed_);
}

const std::vector<char>& Moreau::open_gaps(const VecX& y) {
    if (q_sampled_.size() == 0) return open_;  // no step was taken yet: no gap is known to be open
    const VecX change = y.head(system_.nq) - q_sampled_;
    ambient_to_tangent(p.mechanism, q_sampled_.data(), change.data(), tangent_.data());
    tangent_ = tangent_.cwiseAbs().cwiseMax(0.5 * h_ * v1_.cwiseAbs());
    return watch_.open_after(tangent_);
}

// Solve a sweep. Return its failure if no motion satisfies the laws.
std::optional<Failure> Moreau::attempt_sweep(double t, JointDrives::Step& drives, bool first) {
    return attempt({Failure::Kind::not_converged, Failure::Kind::inconsistent}, [&] { sweep(t, drives, first); });
}

// Solve the step with the forces at the predicted mean velocity. If no motion is found, or only a relaxed one, solve it at
// the velocity of the start.
void Moreau::begin_sweeps(double t, JointDrives::Step& drives) {
    const auto failure = attempt_sweep(t, drives, true);
    if (failure && !mean_.is_predicted()) throw *failure;
    if (!mean_.is_predicted() || (!failure && forces_.law_miss().block < 0)) return;
    forces_.clear_miss();
    mean_.begin(h_, v0_, VelocityRates());
    sweep(t, drives, false);
}

// Solve the step with the forces at the mean velocity found so far.
void Moreau::sweep(double t, JointDrives::Step& drives, bool first) {
    if (first || p.has_user_rows) begin_rows_inside(p, w, t0_, q0_, t, q_mid_, mean_.value());
    if (first) gather(t);
    drives.move(mean_.start(), mean_.value());
    solve_free(t);
    if (!first || mean_.is_predicted()) move_touching(t);
    forces_.pose(mean_, h_, a_free_, first || p.has_user_rows);
    solve(t);
    end_velocity();
}

// Solve the step again with the forces at the mean velocity. If no motion is found, or only a relaxed one, return false
// with the motion of the first sweep.
bool Moreau::correct(double t, JointDrives::Step& drives) {
    const bool relaxed_before = forces_.law_miss().block >= 0;
    const bool is_solved = !attempt_sweep(t, drives, false);
    if (is_solved && (relaxed_before || forces_.law_miss().block < 0)) return true;
    if (!relaxed_before) forces_.clear_miss();
    mean_.restart();
    sweep(t, drives, false);
    return false;
}

// Set contacts and modes, with their rows. During most of a flight nothing changes. `flies`: no contact is closed and
// no element active in the new modes.
void Moreau::select(const std::vector<char>& closed, const std::vector<Mode>& modes, bool flies) {
    for (const StepRow& row : elements_.rows) w.now.lam[p.blocks[row.block].row + row.k] = 0.0;
    if (flies && !system_.watches() && !w.now.rows.redundant && !w.now.rows.orthogonal) w.now.renew();
    else set_contacts(p, w, closed, modes);
}

// Solve the motion without contacts and dry friction, with constraints satisfied at the step's end.
void Moreau::solve_free(double t) {
    assemble_forces(p, w, t, mean_.value());
    solve_dynamics(p, w, t, mean_.value());
    a_free_ = w.now.a;
    if (w.now.rows.blocks.empty()) {
        w.now.rows.distance = 1.0;
        return;
    }
    b_ = w.now.b;
    mean_.meet_at_end(p, w, b_);
    lam_free_.head(p.bilateral_rows()) = w.now.lam.head(p.bilateral_rows());
    solve_motion(p, w, p.has_laws(), b_, a_free_, lam_free_);
}

// Return the travel of each dof since the last sample of the gaps, including projections. The integral of the velocity
// is a lower bound of the travel, because differences of angles omit full turns.
const VecX& Moreau::path_since_last() {
    q_sampled_ -= q_mid_;
    ambient_to_tangent(p.mechanism, q_mid_.data(), q_sampled_.data(), v1_.data());
    tangent_ = v1_.cwiseAbs().cwiseMax(h_ * v0_.cwiseAbs());
    q_sampled_ = q_mid_;
    return tangent_;
}

// Collect the elements that take part, with the rates at the step's start. A velocity after a strike is not predicted.
void Moreau::gather(double t) {
    move_bodies(p.mechanism, w.now.terms, mean_.start());
    find_touching(t);
    elements_.gather(p, w, touching_, was_closed_, modes_, loaded_, mean_);
    if (elements_.strike()) mean_.begin(h_, v0_, VelocityRates());
}

// Find the contacts with a load in the last step.
void Moreau::find_loaded() {
    loaded_.clear();
    const auto add = [&](int block) {
        if (!p.blocks[block].kept.empty() && w.state.percussion[p.blocks[block].row] > 0.0) loaded_.push_back(block);
    };
    if (has_unknown_percussions_)
        for (const Gap& gap : p.gaps) add(gap.block);
    else
        for (const StepRow& row : rows_of_percussions_)
            if (row.k == 0) add(row.block);
    std::sort(loaded_.begin(), loaded_.end());
}

// Find the contacts whose gap is closed at the step's middle, and contacts that were closed before. Their loads decide
// if they stay closed.
void Moreau::find_touching(double t) {
    touching_.clear();
    const double uncertainty = parameters.width_rounding * scene_size(p, w);
    for (int i : watch_.advance(path_since_last())) {
        const double width = measured_width(p, w, t, mean_.start(), i);
        const bool touches = was_closed_[i] || (width <= 0.0 && edges_.has_known_direction(i, width));
        if (touches) touching_.push_back(i);
        watch_.gaps.width[i] = touches ? 0.0 : width - uncertainty;  // guaranteed width
    }
    watch_.skip_wide();
    for (int i : touching_) {
        evaluate_block(p, w, t, mean_.start(), p.gaps[i].block);
        for (int e : p.gaps[i].elements) evaluate_block(p, w, t, mean_.start(), p.frictions[e].block);
    }
    if (touching_.size() > 1) {
        opposed_.drop(p, w, was_closed_, touching_);
        remove_coincident(p, w, touching_, [&](int i, int other) { return was_closed_[i] && !was_closed_[other]; });
    }
}

// Evaluate the contacts that take part at a new mean velocity.
void Moreau::move_touching(double t) {
    for (int i : touching_) {
        move_block(p, w, t, mean_.value(), p.gaps[i].block);
        for (int e : p.gaps[i].elements) move_block(p, w, t, mean_.value(), p.frictions[e].block);
    }
    elements_.move(p, w);
}

// Set the multipliers of the constraints for the forces f. In a step all contacts are open: their other rows have none.
void Moreau::begin_multipliers() {
    if (w.now.rows.blocks.empty()) return;
    const int rows = p.bilateral_rows();
    w.now.lam.head(rows) = lam_free_.head(rows);
    forces_.add_multipliers(w.now.lam);
}

// Compute the motion under the forces f.
void Moreau::apply() {
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(elements_.rows.size());
    w.now.a = a_free_;
    w.now.renew();
    if (n == 0) return;
    forces_.add_motion(w.now.a);
    begin_multipliers();
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        const int head = parts[e].gap >= 0;
        if (head) w.now.lam[p.blocks[p.gaps[parts[e].gap].block].row] = forces_.f[at];
        if (parts[e].element < 0) continue;
        Vec3& force = w.now.slip_force.change(parts[e].element);
        force = Vec3::Zero();
        for (int k = head; k < cones[e].dim; ++k) force[k - head] = forces_.f[at + k];
    }
}

// Elements at rest can share loads in many ways, so that limits which follow the loads need not converge. Solve the step
// with a fraction of these limits. Return true if all elements rest and their forces are within the limits that follow.
bool Moreau::rest_within_limits(double t) {
    elements_.reduce_limits();
    if (!forces_.solve(h_, q0_, v0_)) return false;
    apply();
    forces_.measure_end();
    const auto end = forces_.end_rows.head(static_cast<Eigen::Index>(elements_.rows.size()));
    return EndModes(v0_).is_stopped(h_ * end.cwiseAbs().maxCoeff()) &&
           elements_.limits_hold(p, w, t, mean_, forces_.f);
}

// Find the forces of the step under limits that follow the loads. Friction may grow against slip that constraints prevent
// without end.
void Moreau::solve_forces(double t) {
    if (find_forces(t)) return;
    if (forces_.are_dependent()) {
        forces_.drop_prevented_slip();
        if (find_forces(t)) return;
    }
    const std::vector<int> contradicting = forces_.contradicting_contacts();
    if (!contradicting.empty()) throw Failure(Failure::Kind::inconsistent, t, contradicting);
    std::vector<int> rubbing;
    for (const StepElements::Part& part : elements_.parts)
        if (part.element >= 0) rubbing.push_back(part.element);
    throw Failure(Failure::Kind::not_converged, t, rubbing);
}

// Alternate between the forces and the limits by their loads. Return false if this does not converge.
bool Moreau::find_forces(double t) {
    const int n = static_cast<int>(elements_.rows.size());
    const bool follow_loads = elements_.limits_follow_loads(p);
    elements_.begin_passes();
    for (int pass = 0; n > 0; ++pass) {
        if (follow_loads || pass > 0) apply();
        const double rounding = touching_.empty() ? parameters.stalled_limits : StepForces::parameters.max_residual;
        const double allowed = rounding * forces_.f.head(n).cwiseAbs().maxCoeff();
        if (elements_.limits_settle(p, w, t, mean_, allowed) && pass > 0) break;
        if (pass > 0 && (touching_.empty() || forces_.are_dependent())) elements_.accelerate_limits();
        if (pass == parameters.max_load_passes && rest_within_limits(t)) break;
        if (pass == parameters.max_load_passes || !forces_.solve(h_, q0_, v0_)) return false;
        if (forces_.are_dependent()) forces_.share_loads(h_, v0_);
        ++w.counters.iterations;
    }
    if (n == 0) apply();
    return true;
}

void Moreau::solve(double t) {
    const int n = static_cast<int>(elements_.rows.size());
    solve_forces(t);
    while (elements_.may_give_way(p)) {
        forces_.measure_end();
        const double largest = forces_.f.head(n).cwiseAbs().maxCoeff();
        if (!elements_.give_way(p, w, forces_.f, forces_.end_rows, StepForces::parameters.limit_rounding * largest,
                                rest_rate(v0_) / h_))
            break;
        solve_forces(t);
    }
    keep_percussions();
    if (n == 0) return;
    const ConeResiduals r = forces_.residuals();
    w.counters.signorini = std::max(w.counters.signorini, r.signorini);
    w.counters.coulomb = std::max(w.counters.coulomb, r.coulomb);
    w.counters.dissipation = std::max(w.counters.dissipation, r.dissipation);
}

// Keep the forces as the first guess of the next step.
void Moreau::keep_percussions() {
    const auto entry = [&](const StepRow& row) -> double& { return w.state.percussion[p.blocks[row.block].row + row.k]; };
    if (has_unknown_percussions_) w.state.percussion.setZero();
    has_unknown_percussions_ = false;
    for (const StepRow& row : rows_of_percussions_) entry(row) = 0.0;
    rows_of_percussions_ = elements_.rows;
    for (size_t i = 0; i < rows_of_percussions_.size(); ++i) entry(rows_of_percussions_[i]) = forces_.f[i];
}

// Compute the velocity, the closed contacts and the modes at the step's end. A contact with a load does not open due to a
// rate as small as the residuals of the forces. A force below its limit holds an element whose slip stops. If a solution
// satisfies neither condition, the condition with the smaller error decides.
void Moreau::end_velocity() {
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    const int n = static_cast<int>(elements_.rows.size());
    const VecX& f = forces_.f;
    VecX& end = forces_.end_rows;
    if (n > 0) forces_.measure_end();
    mean_.end(w.now.a, v1_);
    if (had_contacts_) {
        std::fill(closed_.begin(), closed_.end(), char(0));
        std::fill(modes_.begin(), modes_.end(), unloaded);
    }
    if (n == 0) return;
    const EndModes rule(v1_);
    const double clear = StepForces::parameters.limit_rounding * f.head(n).cwiseAbs().maxCoeff();
    const double still = h_ * std::max(forces_.rest_of_rows(), mean_.held_slip(p, a_free_));
    end.head(n) *= h_;
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        const StepElements::Part& part = parts[e];
        const int head = part.gap >= 0, dim = cones[e].dim - head;
        if (head) {
            const double rate = end[at] - part.approach;
            const double error = std::max(still, h_ * forces_.row_error(static_cast<int>(at), 1));
            closed_[part.gap] = rule.is_rest(rate, error) || (f[at] > clear && rule.is_stopped(rate));
        }
        if (part.element < 0 || (head && !closed_[part.gap])) continue;
        const double limit = cones[e].bound * (head ? f[at] : 1.0);
        const double size = dim == 1 ? std::abs(f[at + head] - part.middle) : f.segment(at + head, dim).norm();
        const double slip = end.segment(at + head, dim).norm();
        const double error = h_ * forces_.row_error(static_cast<int>(at), cones[e].dim);
        // In a short step a joint may begin to slip at less than the speed of rest.
        const bool rests = head ? rule.is_rest(slip, std::max(error, still))
                                : rule.is_rest(slip, error) && slip <= still + error;
        const bool holds =
            limit - size > clear && (rule.is_stopped(slip) || rule.is_nearer_to_rest(slip, size, limit));
        const bool forward = dim > 1 || (dim > 0 && end[at + head] > 0.0);
        const Block& block = p.blocks[p.frictions[part.element].block];
        const Mode mode = EndModes::settle(holds || rests, forward, block, v1_);
        modes_[part.element] = dim > 0 ? mode : slip_minus;
    }
    forces_.stop_resting_trees(h_, v0_, v1_);
    const auto rest = [&](int e) {  // elements held by the constraints stick
        if (modes_[e] == unloaded && (p.frictions[e].gap < 0 || closed_[p.frictions[e].gap])) modes_[e] = sticking;
    };
    for (int e : elements_.outside_contacts()) rest(e);
    for (int i : touching_)
        for (int e : p.gaps[i].elements) rest(e);
    had_contacts_ = true;
}

// Add the work over the step, by the mean velocity. The work of contacts along their normals belongs to impacts. If a slip
// reverses inside the step, friction opposes the slip at the step's end and can do positive work on the mean velocity.
// This work is due to the scheme, not to friction.
void Moreau::book_work(VecX& y, double& numerical_energy, double& impact_energy) {
    const auto& rows = elements_.rows;
    const auto& parts = elements_.parts;
    const auto& cones = elements_.cones;
    begin_multipliers();
    tangent_ = 0.5 * (mean_.start() + mean_.finish());
    powers(p, w, tangent_, power_.data());
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        double power = 0.0;
        for (int k = 0; k < cones[e].dim; ++k) {
            const StepRow& row = rows[at + k];
            multiply(p.blocks[row.block], w.now.A, tangent_, w.scratch.r);
            const double part = w.scratch.r[p.blocks[row.block].row + row.k] * forces_.f[at + k];
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
