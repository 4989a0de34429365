// Decomposition of Eq. (39): force of the ideal constraints, and contribution of the nonideal forces.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

// Motion of the ideal constraints, without C and without sticking elements. The workspace holds this motion and its
// factors during the lifetime of the object. The destructor restores the factors of the modes, but not a and lam.
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
    VecX F_ideal, F_nonideal, C, lam, lam_ideal;  // multipliers per row of the descriptions
};
// Compute the ideal and nonideal part of the constraint force at the state last evaluated.
void split_forces(const Program& p, Workspace& w, Split& out);

}  // namespace pn
