// Eq. (39): what the constraints alone would exert, and what the nonideal forces add to it.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// The motion of the ideal constraints: without C, and without what sticks. The workspace holds it, with its factors,
// while this object lives; then the factors are again those of the modes, and a and lam are left to the caller.
class IdealMotion {
public:
    IdealMotion(const Program& p, Workspace& w);
    ~IdealMotion();
    IdealMotion(const IdealMotion&) = delete;
    IdealMotion& operator=(const IdealMotion&) = delete;

private:
    const Program& p;
    Workspace& w;
    bool sticks = false;
};

struct Split {
    VecX F_ideal, F_nonideal, C, lam, lam_ideal;  // multipliers by row of the descriptions
};
// Ideal and nonideal part of the force of constraint at the state last evaluated.
void split_forces(const Program& p, Workspace& w, Split& out);

}  // namespace pn
