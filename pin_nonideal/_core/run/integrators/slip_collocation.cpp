#include "run/integrators/slip_collocation.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/decompositions.hpp"
#include "math/radau.hpp"
#include "run/integrators/slip_tangents.hpp"
#include "run/integrators/step_control.hpp"
#include "tree/lie_group.hpp"

namespace pn {

using radau::points;
using radau::table;
using radau::with_weights;

namespace {

// Error estimate: defect of the polynomial's rate at the start, times this fraction of the step. For a smooth motion it is a
// few times the error of the interpolant.
constexpr double defect_part = 1.0 / (2 * Collocation::stages + 1);

}  // namespace

Collocation::Collocation(Step& step, System& system, ErrorNorm& norm) : step_(step), system_(system), norm_(norm) {
    for (auto* list : {&F_, &Y_, &next_}) list->resize(stages);
    for (auto* list : {&u_, &n_, &turned_}) list->resize(stages);
    for (auto* list : {&A_, &T_, &P_, &Q_}) list->resize(stages);
}

double Collocation::abscissa(int stage) { return points[stage]; }

// Collect the elements with unknown directions: slipping elements with several directions.
void Collocation::gather() {
    const Program& p = system_.p;
    elements_.clear();
    rows_ = tangents_ = 0;
    for (int e = 0; e < system_.ne; ++e) {
        const int dim = p.frictions[e].dim;
        if (dim == 1 || !slips(system_.w.state.mode[e])) continue;
        elements_.push_back({e, dim, rows_, tangents_});
        rows_ += dim;
        tangents_ += dim - 1;
    }
    start_n_.resize(rows_);
    for (const Element& e : elements_)
        for (int k = 0; k < e.dim; ++k) start_n_[e.row + k] = system_.w.state.slip_direction[e.index][k];
}

bool Collocation::has_directions() {
    gather();
    return tangents_ > 0;
}

// Initialize the stages from the last trial of the step, which had another length.
void Collocation::stretch() {
    const double ratio = step_.h / warm_start_size_;
    const std::vector<VecX> n_before = n_;
    for (int i = 0; i < stages; ++i) {
        n_[i].setZero();
        next_[i].setZero();
        with_weights(points[i] * ratio, [&](int k, double weight) {
            n_[i] += weight * (k == 0 ? start_n_ : n_before[k - 1]);
            next_[i] += weight * (k == 0 ? step_.y0 : Y_[k - 1]);
        });
        for (const Element& e : elements_) n_[i].segment(e.row, e.dim).normalize();
    }
    Y_.swap(next_);
}

// Initialize the stages by the rate at the start, and size the buffers for the elements.
void Collocation::extrapolate_straight() {
    sigma_.resize(elements_.size(), stages);
    G_.resize(system_.nv, rows_);
    for (int i = 0; i < stages; ++i) {
        n_[i] = start_n_;
        u_[i].resize(rows_);
        A_[i].resize(rows_, system_.nv);
        T_[i].resize(rows_, tangents_);
        Y_[i] = step_.y0 + (points[i] * step_.h) * step_.start_rate();
    }
}

void Collocation::set_directions(int stage) const {
    for (const Element& e : elements_)
        for (int k = 0; k < e.dim; ++k) system_.w.state.last_direction[e.index][k] = n_[stage][e.row + k];
}

void Collocation::evaluate_stages(bool first) {
    const Program& p = system_.p;
    Workspace& w = system_.w;
    for (int i = 0; i < stages; ++i) {
        set_directions(i);
        system_.derivative(step_.t0 + points[i] * step_.h, Y_[i], F_[i]);
        A_[i].setZero();
        for (size_t at = 0; at < elements_.size(); ++at) {
            const Element& e = elements_[at];
            const Block& block = p.blocks[p.frictions[e.index].block];
            const int n = static_cast<int>(block.kept.size());
            const double* A = w.now.A.data() + block.offset;
            for (size_t l = 0; l < block.support().size(); ++l)
                for (int k = 0; k < n; ++k) A_[i](e.row + k, block.support()[l]) = A[l * n + k];
            const Vec3 slip = slip_velocity(w.now, p.frictions[e.index]);
            for (int k = 0; k < e.dim; ++k) u_[i][e.row + k] = slip[k];
            if (first) sigma_(at, i) = u_[i].segment(e.row, e.dim).dot(n_[i].segment(e.row, e.dim));
        }
    }
}

// Compute the derivatives of the acceleration by each direction, including the loads that follow it. The workspace is
// at the step's end, after the last stage.
void Collocation::find_response() {
    Workspace& w = system_.w;
    const double end = step_.t0 + step_.h;
    const VecX acceleration = w.now.a, v = w.now.v;
    for (const Element& e : elements_) {
        for (int k = 0; k < e.dim; ++k) {
            double& component = w.state.last_direction[e.index][k];
            const double before = component;
            component += parameters.perturbation;
            solve_dynamics(system_.p, w, end, v);
            component = before;
            G_.col(e.row + k) = (w.now.a - acceleration) / parameters.perturbation;
        }
    }
}

void Collocation::add_tangents(int i) {
    T_[i].setZero();
    for (const Element& e : elements_) set_tangents(n_[i], e.row, e.dim, T_[i], e.tangent);
    P_[i].noalias() = T_[i].transpose() * A_[i];
    Q_[i].noalias() = G_ * T_[i];
}

// Solve for the turns of all directions together. Across n the slip velocity u_i from the rates must vanish,
//     T^T (u_i + A_i h sum_j a_ij G T_j turn_j) - sigma_i turn_i = 0.
void Collocation::solve_turns() {
    const int m = tangents_, nv = system_.nv, nq = system_.nq;
    K_.resize(stages * m, stages * m);
    residual_.resize(stages * m);
    const VecX fastest = sigma_.cwiseAbs().rowwise().maxCoeff();
    bool at_rest = false;
    for (int i = 0; i < stages; ++i) {
        VecX moved = step_.y0.segment(nq, nv) - Y_[i].segment(nq, nv);
        for (int j = 0; j < stages; ++j) {
            moved += (step_.h * table.a[i][j]) * F_[j].segment(nq, nv);
            K_.block(i * m, j * m, m, m).noalias() = (step_.h * table.a[i][j]) * P_[i] * Q_[j];
        }
        u_[i] += A_[i] * moved;
        residual_.segment(i * m, m) = T_[i].transpose() * u_[i];
        for (size_t at = 0; at < elements_.size(); ++at) {
            at_rest |= std::abs(sigma_(at, i)) <= parameters.rank_threshold * fastest[at];
            for (int k = 0; k < elements_[at].dim - 1; ++k) {
                const int row = i * m + elements_[at].tangent + k;
                K_(row, row) -= sigma_(at, i);
            }
        }
    }
    if (!at_rest) {
        LU factor;
        factor.compute(K_);
        factor.solve(residual_, turn_);
        turn_ = -turn_;
        return;
    }
    turn_ = -least_squares(K_, residual_, parameters.rank_threshold);
}

// Turn the directions, and update the accelerations.
void Collocation::turn_directions() {
    for (int i = 0; i < stages; ++i) {
        n_before_ = n_[i];
        n_[i] += T_[i] * turn_.segment(i * tangents_, tangents_);
        for (const Element& e : elements_) n_[i].segment(e.row, e.dim).normalize();
        turned_[i] = G_ * (n_[i] - n_before_);
        F_[i].segment(system_.nq, system_.nv) += turned_[i];
    }
}

// Update the states of the stages under the turned directions.
void Collocation::move_stages() {
    const int nq = system_.nq;
    const auto integrate = [&](int from, int size) {
        for (int i = 0; i < stages; ++i) {
            next_[i].segment(from, size) = step_.y0.segment(from, size);
            for (int j = 0; j < stages; ++j)
                next_[i].segment(from, size) += (step_.h * table.a[i][j]) * F_[j].segment(from, size);
        }
    };
    integrate(nq, static_cast<int>(step_.y0.size()) - nq);
    for (int i = 0; i < stages; ++i)
        configuration_rate(system_.p.mechanism, Y_[i].data(), next_[i].data() + nq, F_[i].data());
    integrate(0, nq);
    for (int i = 0; i < stages; ++i) {
        VecX slip = u_[i];
        for (int j = 0; j < stages; ++j) slip += (step_.h * table.a[i][j]) * (A_[i] * turned_[j]);
        for (size_t at = 0; at < elements_.size(); ++at) {
            const Element& e = elements_[at];
            sigma_(at, i) = slip.segment(e.row, e.dim).dot(n_[i].segment(e.row, e.dim));
        }
    }
}

void Collocation::correct() {
    for (int i = 0; i < stages; ++i) add_tangents(i);
    solve_turns();
    turn_directions();
    move_stages();
}

double Collocation::change() {
    double most = 0.0;
    norm_.set_tolerances(step_.y0, next_[stages - 1], step_.h);
    for (int i = 0; i < stages; ++i) {
        error_ = next_[i] - Y_[i];
        most = std::max(most, norm_(error_, step_.y0));
    }
    Y_.swap(next_);
    return most;
}

void Collocation::measure_stiffness() {
    const MatX across = P_[stages - 1] * Q_[stages - 1];
    stiffness_ = 0.0;
    for (size_t at = 0; at < elements_.size(); ++at)
        for (int k = 0; k < elements_[at].dim - 1; ++k)
            stiffness_ = std::max(stiffness_, step_.h * across.row(elements_[at].tangent + k).cwiseAbs().sum() /
                                                  std::abs(sigma_(at, stages - 1)));
}

// Check if an iteration has changed the stages by `now` tolerances, and the iteration before by `last`, without a chance to
// converge.
bool Collocation::diverges(int iteration, double now, double last) const {
    if (!std::isfinite(now)) return true;
    if (iteration == 0) return turn_.cwiseAbs().maxCoeff() > parameters.farthest_turn;
    const double max_ratio = iteration > 1 ? parameters.diverging : parameters.diverging_first;
    return now / last > max_ratio && now > parameters.rounding_part;
}

bool Collocation::has_converged(int iteration, double now, double last) const {
    if (now <= parameters.solved_at_once) return true;
    if (iteration == 0) return false;
    const double ratio = now / last;
    const bool is_rounding = ratio > parameters.diverging && now <= parameters.rounding_part;
    return is_rounding || now * ratio <= parameters.solved_part * (1.0 - ratio);
}

void Collocation::advance() {
    const bool again = has_warm_start_;
    if (error_.size() == 0) {  // most runs never solve for directions
        error_ = VecX::Zero(system_.ny);
        for (auto* list : {&F_, &Y_, &next_}) list->assign(stages, error_);
    }
    gather();
    converged_ = has_warm_start_ = false;
    step_.y1 = step_.y0;
    RunState& state = system_.w.state;
    for (const Element& e : elements_) state.last_direction[e.index] = state.slip_direction[e.index];
    if (step_.h == 0.0) return;
    if (again) stretch();
    else extrapolate_straight();
    double last = HUGE_VAL;
    for (int it = 0; it < parameters.max_iterations; ++it) {
        evaluate_stages(it == 0);
        if (it == 0 && !again) find_response();
        correct();
        const double now = change();
        if (diverges(it, now, last)) return;
        converged_ = has_converged(it, now, last);
        last = now;
        if (converged_) break;
    }
    if (!converged_) return;
    has_warm_start_ = true;
    warm_start_size_ = step_.h;
    measure_stiffness();
    step_.y1 = Y_[stages - 1];
    system_.normalize(step_.y1);
    set_directions(stages - 1);
}

double Collocation::error() {
    if (!converged_) return is_solved() ? 0.0 : failed_error;
    const int nq = system_.nq, nv = system_.nv;
    const double part = defect_part * step_.h;
    error_ = part * step_.start_rate();
    VecX speed = VecX::Zero(elements_.size());
    for (int j = 0; j < stages; ++j) {
        error_ -= (part * table.at_start[j]) * F_[j];
        speed += table.at_start[j] * sigma_.col(j);
    }
    // Components of the error along slip directions decay as the directions relax. The filter (1 - part df/dv)^-1 reduces
    // these components.
    MatX K = part * P_[0] * Q_[0];
    for (size_t at = 0; at < elements_.size(); ++at)
        for (int k = 0; k < elements_[at].dim - 1; ++k) {
            const int row = elements_[at].tangent + k;
            K(row, row) -= std::max(0.0, speed[at]);
        }
    const VecX across = P_[0] * error_.segment(nq, nv);
    error_.segment(nq, nv) -= part * (Q_[0] * least_squares(K, across, parameters.rank_threshold));
    norm_.set_tolerances(step_.y0, step_.y1, step_.h);
    return norm_(error_, step_.y0);
}

void Collocation::interpolate(double part, VecX& y) const {
    auto state = y.head(step_.states);
    state.setZero();
    with_weights(part, [&](int k, double weight) {
        state += weight * (k == 0 ? step_.y0 : k == stages ? step_.y1 : Y_[k - 1]).head(step_.states);
    });
    set_directions_at(part);
}

double Collocation::interpolated(double part, int index) const {
    double value = 0.0;
    with_weights(part, [&](int k, double weight) {
        value += weight * (k == 0 ? step_.y0 : k == stages ? step_.y1 : Y_[k - 1])[index];
    });
    return value;
}

// Return one entry of the polynomial through the stages' rates.
double Collocation::interpolated_rate(double part, int index) const {
    double rate = 0.0, sum = 0.0;
    for (int j = 0; j < stages; ++j) {
        if (part == points[j]) return F_[j][index];
        const double weight = table.barycentric[j + 1] * points[j] / (part - points[j]);  // without the node at 0
        rate += weight * F_[j][index];
        sum += weight;
    }
    return rate / sum;
}

void Collocation::set_directions_at(double part) const {
    for (const Element& e : elements_) {
        Vec3 n = Vec3::Zero();
        with_weights(part, [&](int k, double weight) {
            for (int c = 0; c < e.dim; ++c) n[c] += weight * (k == 0 ? start_n_ : n_[k - 1])[e.row + c];
        });
        system_.w.state.last_direction[e.index] = n.normalized();
    }
}

}  // namespace pn
