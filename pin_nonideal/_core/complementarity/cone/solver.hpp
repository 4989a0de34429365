// Solver of contacts with Coulomb friction, for accelerations, impacts and time stepping. The solver finds f of the problem
// of cone/problem.hpp for any square W (of any rank, symmetric or not). Newton's method on the modes starts from a warm
// start, or else from zero. The fallbacks are Newton's method from the end of the central path, then proximal points with
// decreasing compliance, then random starts. A certificate that a solution may not exist prevents random starts. Buffers
// grow to the largest problem. A call allocates no memory after that.
#pragma once

#include "complementarity/cone/certificate.hpp"
#include "complementarity/cone/newton.hpp"
#include "complementarity/cone/minimum_norm.hpp"
#include "complementarity/cone/residuals.hpp"

namespace pn {

struct ConeComplementarityParameters {
    double tolerance = 1e-11;               // error of a solution
    double no_force = 1e10;                 // larger forces, in the problem's units, squeeze bodies without moving them
    double path_rest_velocity = 1e-7;       // velocity of rest at the end of the central path, relative to the largest w0
    double rest_velocity = 1e-12;           // velocity of rest of a solution, relative to its terms
    double velocity_rounding = 1e-14;       // rounding error relative to the largest velocity
    double minimum_norm_tolerance = 1e-13;  // error of a minimum-norm solution
    // Newton steps from near a solution, from a guess, and from the end of the central path or of a continuation.
    int few_steps = 3, first_steps = 20, more_steps = 30;
    // Compliance of elements relative to their own response. The compliance halves from the first value to the last.
    double first_compliance = 1e-2, min_compliance = 1e-9;
    int max_proximal_steps = 40;    // proximal steps, of which 24 reach the last compliance
    double compliance_ratio = 0.1;  // ratio of successive compliances, if only the limit is needed
    int max_random_starts = 100;    // random starts
    // Residual below which the search ends if residuals are accepted, and ratio of successive residuals that counts as
    // stagnation. If the residual stagnates while elements stiffen, no forces change it. Elements that share a load,
    // such as the corners of a turning foot, then have contradicting velocities.
    double stalled_residual = 1e-9, stall_ratio = 0.9;
};

class ConeComplementarity {
public:
    using Parameters = ConeComplementarityParameters;
    static constexpr Parameters parameters{};

    // Solve for f. If `warm`, f holds a guess (often the solution of the previous step), otherwise its value is
    // ignored. If the result is not `solved`, f is the best point found. If the forces are not unique, f has minimum norm.
    // With `may_keep_shares`, a guess that solves the problem is returned unchanged.
    ConeStatus solve(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                     const std::vector<ConeElement>& elements, bool warm, Eigen::Ref<VecX> f,
                     bool may_keep_shares = false);
    // Computes forces within their cones that cancel w0. Return false if there are none: the convex program of the
    // associated law has w = 0 as its only solution exactly if such forces exist.
    bool hold(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
              const std::vector<ConeElement>& elements, Eigen::Ref<VecX> f);

    // Check if f, the unique forces of a solution just found, is one of several solutions, and set f to another one. At
    // rest the determinants of the equations have signs that sum up to one over all regular solutions. A solution with a
    // negative determinant is therefore one of at least three, and the others are sought from random starts.
    bool replace_reversed(Eigen::Ref<VecX> f);

    // Accept a relative residual up to `max_residual` if no forces satisfy the laws to rounding. The caller then
    // reports the residual. By default no residual is accepted.
    void accept_residual(double max_residual) { max_residual_ = max_residual; }

    // Use a uniform compliance. If friction depends on shares of a load that W does not determine, several motions may
    // solve the problem. This option selects the motion of equally compliant elements, in the limit of stiff ones. This
    // motion does not depend on the order of the elements. From a guess, a solution near it or with unique shares is kept.
    void use_uniform_compliance(bool on) { uniform_compliance_ = on; }

    // Limit the search to Newton's method from the guess, from zero and from the end of the central path.
    void search_briefly(bool on) { brief_ = on; }

    double error() const { return error_; }             // relative error of the equations
    bool unique_shares() const { return unique_shares_; }  // W is shown to determine all of f
    const VecX& certificate() const { return certificate_; }
    int newton_steps() const { return newton_.steps(); }
    int path_steps() const { return interior_point_.steps(); }

private:
    bool search(Eigen::Ref<VecX> f);
    bool polish(Eigen::Ref<VecX> f, int max_steps);
    bool stands_still(const Eigen::Ref<const VecX>& f);
    bool proximal_point(Eigen::Ref<VecX> f);
    bool compliance_continuation(Eigen::Ref<VecX> f);
    template <class Accept>
    bool random_restarts(Eigen::Ref<VecX> f, const Accept& accept);
    void tidy(Eigen::Ref<VecX> f) const;

    ConeProblem problem_, grown_;
    ConeNewton newton_;
    ConeInteriorPoint interior_point_;
    MinimumNormForces minimum_norm_;
    Buffer even_, x_, f_, w_, best_;
    VecX certificate_;
    double error_ = 0.0, max_residual_ = 0.0;
    bool unique_shares_ = false, uniform_compliance_ = false, brief_ = false;
};

}  // namespace pn
