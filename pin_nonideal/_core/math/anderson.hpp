// Acceleration of a fixed-point iteration x := g(x) by its last residuals (D. G. Anderson, "Iterative procedures for
// nonlinear integral equations", J. ACM 12, 1965; H. F. Walker, P. Ni, SIAM J. Numer. Anal. 49, 2011). With one unknown
// this is the secant method. If the change of g(x) exceeds the change of x, the fixed point is unstable, and iterations
// without acceleration move away from it.
#pragma once

#include "math/spatial.hpp"

namespace pn {

struct AndersonParameters {
    int memory = 3;                   // maximum number of changes of the residual in use
    double dependent_change = 1e-10;  // pivot of these changes, relative to the largest, that counts as zero
};

class AndersonAcceleration {
public:
    using Parameters = AndersonParameters;
    static constexpr Parameters parameters{};

    // Forget the iterates.
    void restart() { count_ = 0; }
    // Return the next iterate after x, with g(x).
    VecX next(const VecX& x, const VecX& g);

private:
    int count_ = 0;  // iterates so far
    VecX last_value_, last_residual_;
    MatX value_changes_, residual_changes_;  // by column, in a ring
};

}  // namespace pn
