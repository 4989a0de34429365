// Errors of the laws of contact and friction, as statistics of runs report them.
#pragma once

#include "complementarity/cone/problem.hpp"

namespace pn {

// Largest errors, relative to the velocity scale (the largest |w0|, or |W| |f| if that is larger), to the largest
// force, and to their product.
struct ConeResiduals {
    double signorini = 0.0;    // error of w_n >= 0, f_n >= 0, f_n w_n = 0
    double coulomb = 0.0;      // error of |f_t| <= mu f_n, |f| <= limit
    double dissipation = 0.0;  // error of f_t . w_t = -mu f_n |w_t|, f . w = -limit |w|
};

struct ConeEnergyParameters {
    double factor = 2.0;     // accepted excess of the energy that the forces convey
    double rounding = 1e-9;  // accepted excess, relative to the same energy for a diagonal W
};

// Check if forces add energy. Forces that solve the laws satisfy f . w <= 0, that is, f^T W f <= -f . w0. `conveyed` is
// f^T W f, `free` is -f . w0, and `uncoupled` is `conveyed` for a diagonal W. Errors relative to the forces do not show
// this if the forces are far too large.
bool add_energy(double conveyed, double free, double uncoupled);
// Check if the forces f of a problem add energy.
bool add_energy(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0, const Eigen::Ref<const VecX>& f);

// Add the errors of an element with forces f and velocities w to `out`. `force` and `speed` are their scales.
void add_residuals(const ConeElement& element, const double* f, const double* w, double force, double speed,
                   ConeResiduals& out);
// Return the largest errors of the forces f of a problem.
ConeResiduals cone_residuals(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                             const std::vector<ConeElement>& elements, const Eigen::Ref<const VecX>& f);

}  // namespace pn
