// The solver of contacts with Coulomb's friction: for accelerations, impacts and time stepping alike. Finds f of the
// problem of cone/problem.hpp for any square W (of any rank, symmetric or not): Newton's method on the modes, from a
// warm start or from nothing; where that does not come to rest, from the end of the central path, from elements that
// give way a little and ever less, from problems with slip speeds held in turn, from forces that are relaxed element by
// element, from no friction on, and from starts drawn by lot. Buffers grow to the largest problem met; a call that gets
// by without the last two takes no memory after that.
#pragma once

#include "complementarity/cone/certificate.hpp"
#include "complementarity/cone/newton.hpp"
#include "complementarity/cone/minimum_norm.hpp"

namespace pn {

// Largest misses, as parts of the velocities in play (the largest |w0|, or |W| |f| where that is more), of the largest
// force, and of their product.
struct ConeResiduals {
    double signorini = 0.0;    // of w_n >= 0, f_n >= 0, f_n w_n = 0
    double coulomb = 0.0;      // of |f_t| <= mu f_n, |f| <= limit
    double dissipation = 0.0;  // of f_t . w_t = -mu f_n |w_t|, f . w = -limit |w|
};

class ConeComplementarity {
public:
    // f holds a guess of the solution when `warm` (often that of the step before); what it was is of no matter else.
    // Where it is not `solved`, f is the best that was met and no more than that. Forces that share a load are the
    // shortest, but where a guess solves the problem as it is and its shares may be kept.
    ConeStatus solve(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                     const std::vector<ConeElement>& elements, bool warm, Eigen::Ref<VecX> f,
                     bool may_keep_shares = false);
    // Computes forces within their cones that cancel w0. Returns false if there are none: the convex program of the
    // associated law has w = 0 as its only solution exactly if such forces exist.
    bool hold(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
              const std::vector<ConeElement>& elements, Eigen::Ref<VecX> f);
    static ConeResiduals residuals(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                                   const std::vector<ConeElement>& elements, const Eigen::Ref<const VecX>& f);

    // Where no forces meet the laws to rounding, those that miss them by up to so much of what is in play are a solution,
    // for those who tell by how much; none by default.
    void take_misses(double most) { most_miss_ = most; }

    // Where friction follows shares of a load that W does not tell, several motions may solve the problem. The one that is
    // taken from now on is that of elements which all give way a little alike, in the limit of stiff ones, in whatever order
    // they come.
    void share_alike(bool on) { shares_alike_ = on; }

    double error() const { return error_; }             // of the equations, as part of what is in play
    bool unique_shares() const { return unique_shares_; }  // whether it was shown that W tells all of f
    const VecX& certificate() const { return certificate_; }
    int newton_steps() const { return newton_.steps(); }
    int path_steps() const { return path_.steps(); }

private:
    bool search(Eigen::Ref<VecX> f, bool warm);
    bool polish(Eigen::Ref<VecX> f, int most_steps);
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
    bool unique_shares_ = false, shares_alike_ = false;
};

}  // namespace pn
