// Reset of workspaces that are used for another run.
#pragma once

#include <algorithm>

#include "dynamics/workspace.hpp"

namespace pn {

// Reset every field that a run reads before it writes it. `first`: run state of a new workspace.
inline void reset_workspace(const Program& p, Workspace& w, const RunState& first) {
    w.state = first;
    w.counters = {};
    w.now.has_override = false;
    w.now.not_before = -HUGE_VAL;
    w.now.not_after = HUGE_VAL;
    w.now.several = w.now.no_motion = w.now.ideal = false;
    for (VecX* x : {&w.now.lam, &w.now.reactions.lam, &w.now.C, &w.now.C_smooth, &w.now.base_C, &w.now.a, &w.now.dz})
        x->setZero();
    std::fill(w.now.load.begin(), w.now.load.end(), SlipLimits());
    std::fill(w.now.limit.begin(), w.now.limit.end(), 0.0);
    w.now.slip_force.resize(p.frictions.size());
    w.now.renew();
    select_rows(p, w);
}

}  // namespace pn
