#include "run/time_stepping/contact_projection.hpp"

#include <algorithm>
#include <cmath>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "dynamics/projection.hpp"
#include "math/tolerances.hpp"
#include "tree/lie_group.hpp"

namespace pn {

static void hold_locked(const Program& p, const Workspace& w, VecX& x) {
    for (int dof = 0; dof < p.mechanism.nv; ++dof)
        if (w.now.terms.locked[dof]) x[dof] = 0.0;
}

static double prescribed_rate(const Workspace& w, const TreeBlocks::Held& held) {
    return -w.now.values[held.block].phi_t[0];
}

ContactProjection::ContactProjection(const Program& p)
    : blocks_(p), flyers_(MeanVelocity::flyers(p)), r_(VecX::Zero(p.layout.rows)), move_(VecX::Zero(p.mechanism.nv)) {
    least_.lever = p.mechanism.lever;
    blocks_.hold_prescribed(p);
    for (const Joint& joint : p.mechanism.joints) weight_ += joint.mass * p.mechanism.gravity.norm();
}

// Add an element of the rows of a block, or join them to the last element.
void ContactProjection::add(int block, int rows, bool joined) {
    for (int k = 0; k < rows; ++k) rows_.push_back({block, k});
    if (joined) elements_.back().dim += rows;
    else elements_.push_back({ConeElement::Kind::equality, rows, 0.0});
    gap_.resize(rows_.size(), -1);
    width_.resize(rows_.size(), 0.0);
}

// Collect the rows that hold. `sticks`: sticking elements must not slide.
void ContactProjection::gather(const Program& p, const Workspace& w, bool sticks) {
    rows_.clear();
    elements_.clear();
    gap_.clear();
    width_.clear();
    const auto kept = [&](int e) { return static_cast<int>(p.blocks[p.frictions[e].block].kept.size()); };
    for (int i : w.now.closed_gaps) {
        const Gap& gap = p.gaps[i];
        if (is_bare(p, i)) continue;
        add(gap.block, 1, false);
        gap_.back() = i;
        if (sticks && gap.sliding >= 0 && w.state.mode[gap.sliding] == sticking)
            add(p.frictions[gap.sliding].block, kept(gap.sliding), true);
    }
    for (const Open& open : penetrating_) {
        add(p.gaps[open.gap].block, 1, false);
        gap_.back() = open.gap;
        width_.back() = open.width;
    }
    for (int e : w.now.loaded_elements) {
        const int gap = p.frictions[e].gap;
        const bool slides = gap >= 0 && p.gaps[gap].sliding == e && !is_bare(p, gap);
        if (sticks && !slides && w.state.mode[e] == sticking && kept(e) > 0) add(p.frictions[e].block, kept(e), false);
    }
}

bool ContactProjection::pose(const Program& p, Workspace& w, bool sticks) {
    gather(p, w, sticks);
    return blocks_.fill(p, w, rows_, elements_, least_.problem) && least_.pose();
}

double ContactProjection::measure_gaps(const Program& p, const Workspace& w) {
    double largest = 0.0;
    for (size_t r = 0; r < rows_.size(); ++r) {
        r_[r] = gap_[r] < 0 ? 0.0 : gap_width(p, w, gap_[r]) - width_[r];
        largest = std::max(largest, std::abs(r_[r]));
    }
    return largest;
}

double ContactProjection::measure_rates(const Program& p, Workspace& w, const VecX& v) {
    double largest = 0.0;
    for (size_t r = 0; r < rows_.size(); ++r) {
        const StepRow& row = rows_[r];
        const Block& block = p.blocks[row.block];
        if (row.k == 0) multiply(block, w.now.A, v, w.scratch.r);
        r_[r] = w.scratch.r[block.row + row.k] + w.now.values[row.block].phi_t[block.kept[row.k]];
        largest = std::max(largest, std::abs(r_[r]));
    }
    return largest;
}

ContactRounding::ContactRounding(const Program& p, const Workspace& w, const VecX& v)
    : gap(projection_floor * scene_size(p, w)), rate(projection_floor * std::max(1.0, v.cwiseAbs().maxCoeff())) {}

// Check if gaps and rates are zero up to rounding, and no tree is slow enough to come to rest.
bool ContactProjection::is_projected(const Program& p, Workspace& w, const VecX& v) {
    const ContactRounding rounding(p, w, v);
    return measure_gaps(p, w) <= rounding.gap && measure_rates(p, w, v) <= rounding.rate &&
           !blocks_.has_slow_tree(v, immobile_speed);
}

// Move q until the gaps are closed. Bodies that turn keep their momentum. Return true if q moves. If rows turn so far
// that the largest gap widens, q ends where it was least.
bool ContactProjection::close_gaps(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    const double floor = projection_floor * scene_size(p, w);
    const auto place = [&] {
        place_bodies(p.mechanism, w.now.terms, q);
        for (int i : w.now.closed_gaps) measure_gap(p, w, t, v, i);
        for (const Open& open : penetrating_) measure_gap(p, w, t, v, open.gap);
    };
    const double before = measure_gaps(p, w);
    double last = HUGE_VAL, least = HUGE_VAL, largest = before;
    int moves = 0, best = 0;
    while (true) {
        if (largest < least) {
            least = largest;
            best = moves;
            q_best_ = q;
            v_best_ = v;
        }
        if (moves == parameters.max_moves) break;
        if (moves > parameters.sure_moves && largest > parameters.stall_ratio * last) break;
        last = largest;
        if (!least_.find(r_, floor, move_)) break;
        hold_locked(p, w, move_);
        q_from_ = q;
        retract(p.mechanism, q_from_.data(), move_.data(), q.data());
        for (const auto& flyer : flyers_) flyer.turn_axes(v, move_.segment<3>(flyer.dof + 3));
        place();
        largest = measure_gaps(p, w);
        ++moves;
    }
    if (!(largest > before)) return moves > 0;
    q = q_best_;
    v = v_best_;
    place();
    return best > 0;
}

// Open the closed contacts that depart faster than the loads of the step can prevent. Return true if a contact opens. The
// elements must be posed.
bool ContactProjection::open_departing_contacts(const Program& p, Workspace& w, double h, const VecX& v) {
    const ContactRounding rounding(p, w, v);
    measure_rates(p, w, v);
    departing_.clear();
    for (int e = 0, row = 0; e < static_cast<int>(elements_.size()); row += elements_[e++].dim)
        if (gap_[row] >= 0 && w.state.closed[gap_[row]] && r_[row] > rounding.rate &&
            gap_width(p, w, gap_[row]) > rounding.gap)
            departing_.push_back(e);
    if (departing_.empty()) return false;
    responses_.resize(elements_.size());
    least_.problem.own_responses(departing_, responses_);
    closed_ = w.state.closed;
    bool opens = false;
    for (int e : departing_) {
        const int row = least_.problem.elements[e].row, gap = gap_[row];
        const double impulse = h * w.state.percussion[p.blocks[p.gaps[gap].block].row];
        if (!departs(r_[row], impulse, responses_[e].c[0][0])) continue;
        closed_[gap] = 0;
        opens = true;
    }
    if (opens) set_closed(p, w, closed_);
    return opens;
}

// Check if a closed contact is left open or penetrates.
bool ContactProjection::is_open(const Program& p, const Workspace& w) const {
    const double allowed = max_projected_gap * scene_size(p, w);
    return std::any_of(w.now.closed_gaps.begin(), w.now.closed_gaps.end(),
                       [&](int i) { return !is_bare(p, i) && std::abs(gap_width(p, w, i)) > allowed; });
}

// Open the closed contacts that other contacts hold apart. Return true if a contact opens.
bool ContactProjection::open_blocked_contacts(const Program& p, Workspace& w) {
    const double allowed = max_projected_gap * scene_size(p, w);
    const auto is_apart = [&](int i) { return !is_bare(p, i) && gap_width(p, w, i) > allowed; };
    if (std::none_of(w.now.closed_gaps.begin(), w.now.closed_gaps.end(), is_apart)) return false;
    closed_ = w.state.closed;
    for (int i : w.now.closed_gaps)
        if (is_apart(i)) closed_[i] = 0;
    set_closed(p, w, closed_);
    return true;
}

// Measure the open contacts of a list.
void ContactProjection::measure_open(const Program& p, Workspace& w, double t, const std::vector<int>& near,
                                     const VecX& v) {
    open_.clear();
    for (int i : near) {
        if (w.state.closed[i] || is_bare(p, i)) continue;
        measure_gap(p, w, t, v, i);
        open_.push_back({i, std::min(0.0, gap_width(p, w, i))});
    }
}

// Find open contacts that the moves so far let penetrate by more than `allowed`. Return true if there are any.
bool ContactProjection::find_penetrating(const Program& p, Workspace& w, double t, const VecX& v, double allowed) {
    const auto stays = [&](const Open& open) {
        measure_gap(p, w, t, v, open.gap);
        return gap_width(p, w, open.gap) >= open.width - allowed;
    };
    const auto first = std::stable_partition(open_.begin(), open_.end(), stays);
    if (first == open_.end()) return false;
    for (auto open = first; open != open_.end(); ++open) {
        evaluate_block(p, w, t, v, p.gaps[open->gap].block);
        penetrating_.push_back(*open);
    }
    open_.erase(first, open_.end());
    return true;
}

void ContactProjection::meet_rates(const Program& p, Workspace& w, VecX& v) {
    double last = HUGE_VAL;
    const double floor = ContactRounding(p, w, v).rate;
    for (int k = 0; k < parameters.max_moves; ++k) {
        const double largest = measure_rates(p, w, v);
        if (k > parameters.sure_moves && largest > parameters.stall_ratio * last) return;
        last = largest;
        if (!least_.find(r_, floor, move_)) return;
        v += move_;
    }
}

// Set velocities of the size of rounding errors to zero where the rows leave no freedom.
void ContactProjection::rest(const Program& p, Workspace& w, VecX& v) {
    for (size_t n = 0; n < least_.problem.nodes.size(); ++n) {
        const BlockNode& node = least_.problem.nodes[n];
        const double speed = v.segment(node.first, node.size).cwiseAbs().maxCoeff();
        if (speed > 0.0 && speed <= immobile_speed && least_.is_immobile(static_cast<int>(n)))
            v.segment(node.first, node.size).setZero();
    }
    hold_locked(p, w, v);
    for (const TreeBlocks::Held& held : blocks_.held()) v[held.dof] = prescribed_rate(w, held);
}

// Move the joints of prescribed motions to their positions and velocities. The other joints of their trees follow. The
// workspace then holds M.
void ContactProjection::meet_prescribed(const Program& p, Workspace& w, double t, VecX& q, VecX& v) {
    if (blocks_.held().empty()) return;
    const auto total = [&] {
        return kinetic_energy(p.mechanism, w.now.terms, v) + potential_energy(p.mechanism, w.now.terms);
    };
    mass_matrix(p.mechanism, w.now.terms);
    const double before = energy ? total() : 0.0;
    move_.setZero();
    for (const TreeBlocks::Held& held : blocks_.held()) move_[held.dof] = -w.now.values[held.block].residual[0];
    if (move_.any()) {
        blocks_.follow_held(p, w, move_);
        q_from_ = q;
        retract(p.mechanism, q_from_.data(), move_.data(), q.data());
        place_bodies(p.mechanism, w.now.terms, q);
        place_rows(p, w, t, v);
        mass_matrix(p.mechanism, w.now.terms);
    }
    move_.setZero();
    for (const TreeBlocks::Held& held : blocks_.held()) move_[held.dof] = prescribed_rate(w, held) - v[held.dof];
    if (move_.any()) {
        blocks_.follow_held(p, w, move_);
        v += move_;
    }
    for (const TreeBlocks::Held& held : blocks_.held()) v[held.dof] = prescribed_rate(w, held);
    if (energy) moved_energy_ = total() - before;
}

bool ContactProjection::project(const Program& p, Workspace& w, double t, double h, const std::vector<int>& near, VecX& q,
                                VecX& v) {
    moved_energy_ = 0.0;
    penetrating_.clear();
    if (!blocks_.applies() || !p.affine_rates) return false;
    w.now.renew();
    place_bodies(p.mechanism, w.now.terms, q);
    place_rows(p, w, t, v);
    meet_prescribed(p, w, t, q, v);
    gather(p, w, true);
    if (is_projected(p, w, v)) hold_locked(p, w, v);
    else if (!correct(p, w, t, h, near, q, v)) return false;
    move_bodies(p.mechanism, w.now.terms, v);
    for (int e : w.now.slipping) move_block(p, w, t, v, p.frictions[e].block);
    ++w.counters.projections;
    return true;
}

// Move q and v onto the rows. Return false if the trees cannot be projected one by one.
bool ContactProjection::correct(const Program& p, Workspace& w, double t, double h, const std::vector<int>& near, VecX& q,
                                VecX& v) {
    if (!has_prescribed()) mass_matrix(p.mechanism, w.now.terms);
    if (!pose(p, w, true)) return false;
    if (open_departing_contacts(p, w, h, v) && !pose(p, w, true)) return false;
    const auto total = [&] {
        return kinetic_energy(p.mechanism, w.now.terms, v) + potential_energy(p.mechanism, w.now.terms);
    };
    const double before = energy ? total() : 0.0;
    measure_open(p, w, t, near, v);
    q_start_ = q;
    v_start_ = v;
    const double largest = measure_gaps(p, w), height = potential_energy(p.mechanism, w.now.terms);
    const double allowed = std::max(largest, h * v.cwiseAbs().cwiseProduct(p.mechanism.lever).maxCoeff());
    bool moves = close_gaps(p, w, t, q, v), posed = true;
    for (int k = 0; k < parameters.max_choices; ++k) {
        const bool penetrates = moves && find_penetrating(p, w, t, v, allowed), opens = is_open(p, w);
        if (!penetrates && (!opens || (k > 0 && !open_blocked_contacts(p, w)))) break;
        posed = false;
        if (!pose(p, w, !opens)) break;  // sticking elements slide only as far as the gaps require
        moves |= close_gaps(p, w, t, q, v);
    }
    penetrating_.clear();
    if (moves && largest > max_projected_gap * scene_size(p, w) &&
        potential_energy(p.mechanism, w.now.terms) - height > parameters.max_lift * weight_ * largest) {
        q = q_start_;
        v = v_start_;
        place_bodies(p.mechanism, w.now.terms, q);
    }
    if (moves) place_rows(p, w, t, v);
    if (moves || !posed) pose(p, w, true);  // velocities follow the rows and the inertia after the move
    meet_rates(p, w, v);
    rest(p, w, v);
    if (energy) moved_energy_ += total() - before;
    return true;
}

}  // namespace pn
