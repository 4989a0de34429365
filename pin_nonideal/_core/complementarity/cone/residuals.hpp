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

// Add the errors of an element with forces f and velocities w to `out`. `force` and `speed` are their scales.
void add_residuals(const ConeElement& element, const double* f, const double* w, double force, double speed,
                   ConeResiduals& out);
// Return the largest errors of the forces f of a problem.
ConeResiduals cone_residuals(const Eigen::Ref<const MatX>& W, const Eigen::Ref<const VecX>& w0,
                             const std::vector<ConeElement>& elements, const Eigen::Ref<const VecX>& f);

}  // namespace pn
