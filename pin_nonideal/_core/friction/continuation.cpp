#include "friction/continuation.hpp"

#include "dynamics/projection.hpp"
#include "dynamics/slip.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

namespace {

constexpr double slack = 1e-9;  // part of the limit, or of the accelerations in play, by which rounding may miss

// Whether the elements at rest keep the conditions of their modes in the motion at hand.
bool keep_conditions(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                     const std::vector<int>& at_rest) {
    const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
    for (int e : at_rest) {
        const bool keeps = w.state.mode[e] == sticking
                               ? friction_force(p, w, e).norm() <= static_limit(p, w, e, t, q, v) * (1.0 + slack)
                               : slip_rate_along_mode(p, w, e) >= -slack * size;
        if (!keeps) return false;
    }
    return true;
}

}  // namespace

bool go_on(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuestion& question, int element) {
    const Friction& friction = p.frictions[element];
    const Mode before = question.modes[element];
    const bool breaks = !question.breaking.empty();
    // What gives way moves on its own only where no others hold the same freedom.
    const bool alone = friction.dim == 1 && question.breaking.size() == 1 && !w.now.rows.redundant;
    if (p.needs_reactions || (breaks && !alone)) return false;
    std::vector<Mode> trials{sticking};
    if (breaks) trials = {friction_force(p, w, element)[0] < 0.0 ? slip_plus : slip_minus};
    else if (friction.dim == 1) trials.push_back(before == slip_plus ? slip_minus : slip_plus);
    const VecX q_before = q, v_before = v;
    for (Mode trial : trials) {
        std::vector<Mode> modes = question.modes;
        for (int e : question.at_rest) modes[e] = e == element ? trial : sticking;
        set_modes(p, w, modes);
        try {
            project(p, w, t, q, v);
            begin_step(p, w, t, q, v);
            if (keep_conditions(p, w, t, q, v, question.at_rest)) return true;
        } catch (const Failure& failure) {
            if (failure.kind != Failure::Kind::inconsistent) throw;
        }
        q = q_before;
        v = v_before;
    }
    return false;
}

}  // namespace pn
