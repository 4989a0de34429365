// Solver of contacts with Coulomb friction, for accelerations, impacts and time stepping. It finds f of the problem of
// cone/problem.hpp for any square W (of any rank, symmetric or not). Newton's method on the modes starts from a warm
// start or from zero. If it fails, the fallbacks are: (1) Newton's method from the end of the central path, (2)
// proximal points with decreasing compliance, (3) alternation with fixed slip speeds, (4) projected Gauss-Seidel, (5)
// continuation from zero friction, (6) random starts. Buffers grow to the largest problem. A call without the last two
// fallbacks allocates no memory after that.
#pragma once

#include "complementarity/cone/certificate.hpp"
#include "complementarity/cone/newton.hpp"
#include "complementarity/cone/minimum_norm.hpp"

namespace pn {

// Largest errors, relative to the velocity scale (the largest |w0|, or |W| |f| if that is larger), to the largest
// force, and to their product.
struct ConeResiduals {
    double signorini = 0.0;    // error of w_n >= 0, f_n >= 0, f_n w_n = 0
    double coulomb = 0.0;      // error of |f_t| <= mu f_n, |f| <= limit
    double dissipation = 0.0;  // error of f_t . w_t = -mu f_n |w_t|, f . w = -limit |w|
};

// Add the errors of an element with forces f and velocities w to `out`. `force` and `speed` are their scales.
void add_residuals(const ConeElement& element, const double* f, const double* w, double force, double speed,
                   ConeResiduals& out);

class ConeComplementarity {
public:
    // Solve for f. If `warm`, f holds a guess (often the solution of the previous step), otherwise its value is
    // ignored. If the result is not `solved`, f is the best point found. Forces that share a load have minimum norm.
    // With `may_keep_shares`, a guess that solves the problem keeps its shares.
    ConeStatus solve(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                     const std::vector<ConeElement>& elements, bool warm, Eigen::Ref<VecX> f,
                     bool may_keep_shares = false);
    // Computes forces within their cones that cancel w0. Returns false if there are none: the convex program of the
    // associated law has w = 0 as its only solution exactly if such forces exist.
    bool hold(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
              const std::vector<ConeElement>& elements, Eigen::Ref<VecX> f);
    static ConeResiduals residuals(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                                   const std::vector<ConeElement>& elements, const Eigen::Ref<const VecX>& f);

    // Accept a relative residual up to `most` if no forces meet the laws to rounding. The caller then reports the
    // residual. By default no residual is accepted.
    void take_misses(double most) { most_miss_ = most; }

    // Use a uniform compliance. If friction depends on shares of a load that W does not determine, several motions may
    // solve the problem. This option selects the motion of equally compliant elements, in the limit of stiff ones. It
    // does not depend on the order of the elements.
    void share_alike(bool on) { shares_alike_ = on; }

    // Limit the search to Newton's method from the guess, from zero and from the end of the central path.
    void search_briefly(bool on) { brief_ = on; }

    double error() const { return error_; }             // relative error of the equations
    bool unique_shares() const { return unique_shares_; }  // W is shown to determine all of f
    const VecX& certificate() const { return certificate_; }
    int newton_steps() const { return newton_.steps(); }
    int path_steps() const { return path_.steps(); }

private:
    bool search(Eigen::Ref<VecX> f, bool warm);
    bool polish(Eigen::Ref<VecX> f, int most_steps);
    bool stands_still(const Eigen::Ref<const VecX>& f);
    bool approach(Eigen::Ref<VecX> f);
    bool take_nearest(Eigen::Ref<VecX> f);
    bool stiffen(Eigen::Ref<VecX> f);
    bool take_turns(Eigen::Ref<VecX> f);
    bool relax(Eigen::Ref<VecX> f);
    bool grow_friction(Eigen::Ref<VecX> f);
    bool scatter(Eigen::Ref<VecX> f);
    void tidy(Eigen::Ref<VecX> f) const;

    ConeProblem problem_, grown_;
    ConeNewton newton_;
    ConePath path_;
    ConeShares shares_;
    Buffer even_, x_, f_, w_, nearest_;
    VecX certificate_;
    double error_ = 0.0, least_miss_ = 0.0, most_miss_ = 0.0;
    bool unique_shares_ = false, shares_alike_ = false, brief_ = false;
};

}  // namespace pn
