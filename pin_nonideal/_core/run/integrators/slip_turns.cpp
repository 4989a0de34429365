// Turns of the slip directions in an iteration of Collocation: response to the directions, and one linear system for all
// stages.
#include <algorithm>
#include <cmath>

#include "dynamics/evaluation.hpp"
#include "math/decompositions.hpp"
#include "math/radau.hpp"
#include "run/integrators/radau_slip.hpp"

namespace pn {

using radau::table;

// Compute the derivatives of the acceleration by each direction, including the loads that follow it. The workspace is
// at the step's end, after the last stage.
void Collocation::find_response() {
    Workspace& w = system_.w;
    const double end = step_.t0 + step_.h;
    const VecX here = w.now.a, v = w.now.v;
    for (const Element& e : elements_) {
        for (int k = 0; k < e.dim; ++k) {
            double& component = w.state.last_direction[e.index][k];
            const double before = component;
            component += parameters.perturbation;
            solve_dynamics(system_.p, w, end, v);
            component = before;
            G_.col(e.row + k) = (w.now.a - here) / parameters.perturbation;
        }
    }
}

// Unit vectors across the direction of an element. One component of a direction is at most the root of 1/3.
constexpr double one_third_root = 0.5774;
static void tangents(const VecX& n, int row, int dim, MatX& T, int column) {
    if (dim == 2) {
        T(row, column) = -n[row + 1];
        T(row + 1, column) = n[row];
        return;
    }
    const Vec3 along(n[row], n[row + 1], n[row + 2]);
    const Vec3 other = std::abs(along[0]) < one_third_root ? Vec3::UnitX() : Vec3::UnitY();
    const Vec3 first = along.cross(other).normalized(), second = along.cross(first);
    for (int k = 0; k < 3; ++k) {
        T(row + k, column) = first[k];
        T(row + k, column + 1) = second[k];
    }
}

void Collocation::add_tangents(int i) {
    T_[i].setZero();
    for (const Element& e : elements_) tangents(n_[i], e.row, e.dim, T_[i], e.tangent);
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
        turned_[i] = n_[i];
        n_[i] += T_[i] * turn_.segment(i * tangents_, tangents_);
        for (const Element& e : elements_) n_[i].segment(e.row, e.dim).normalize();
        turned_[i] = G_ * (n_[i] - turned_[i]);
        F_[i].segment(system_.nq, system_.nv) += turned_[i];
    }
}

void Collocation::measure_stiffness() {
    const MatX across = P_[stages - 1] * Q_[stages - 1];
    stiffness_ = 0.0;
    for (size_t at = 0; at < elements_.size(); ++at)
        for (int k = 0; k < elements_[at].dim - 1; ++k)
            stiffness_ = std::max(stiffness_, step_.h * across.row(elements_[at].tangent + k).cwiseAbs().sum() /
                                                  std::abs(sigma_(at, stages - 1)));
}

}  // namespace pn
