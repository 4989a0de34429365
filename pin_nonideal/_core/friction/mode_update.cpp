#include "friction/mode_update.hpp"

#include <optional>

#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

namespace {

// What sticks from now on loses slip of rounding. In a dead point of a loop, where slip turns while all else moves on,
// that slip could stop everything: a velocity that changes by this part moves.
constexpr double least_speed = 1e-6;
constexpr double slack = 1e-9;  // part of the limit, or of the accelerations in play, by which rounding may miss
constexpr int rounds = 6;       // of modes that are changed where their conditions fail; the program goes on from there

// Sets right the modes whose conditions fail in the motion at hand: what is past its limit slips, what is driven against
// its slip sticks. Returns how many; nothing where one motion does not tell, for elements of several directions or for
// those that share what they hold.
std::optional<int> change_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                const std::vector<int>& at_rest, std::vector<Mode>& modes) {
    const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
    int changed = 0;
    for (int e : at_rest) {
        if (modes[e] == sticking) {
            const HoldingForce held = holding_force(p, w, e, t, q, v);
            if (held.is_within(slack)) continue;
            if (p.frictions[e].dim > 1 || w.now.rows.redundant) return std::nullopt;
            modes[e] = held.force[0] < 0.0 ? slip_plus : slip_minus;
        } else {
            if (slip_rate_along_mode(p, w, e) >= -slack * size) continue;
            modes[e] = sticking;
        }
        ++changed;
    }
    return changed;
}

}  // namespace

bool go_on(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuestion& question, int element) {
    const bool breaks = !question.breaking.empty();
    // What gives way moves on its own only where no others hold the same freedom.
    const bool alone = p.frictions[element].dim == 1 && question.breaking.size() == 1 && !w.now.rows.redundant;
    if (p.needs_reactions || (breaks && !alone)) return false;
    std::vector<Mode> modes = question.modes;
    for (int e : question.at_rest) modes[e] = sticking;
    if (breaks) modes[element] = holding_force(p, w, element, t, q, v).force[0] < 0.0 ? slip_plus : slip_minus;
    const VecX q_before = q, v_before = v;
    for (int round = 0; round < rounds; ++round) {
        set_modes(p, w, modes);
        try {
            project_into_modes(p, w, t, q, v);
            if ((v - v_before).cwiseAbs().maxCoeff() > least_speed * (1.0 + v_before.cwiseAbs().maxCoeff())) break;
            begin_step(p, w, t, q, v);
        } catch (const Failure& failure) {
            if (failure.kind != Failure::Kind::inconsistent) throw;
            break;
        }
        const std::optional<int> changed = change_modes(p, w, t, q, v, question.at_rest, modes);
        if (changed == 0) return true;
        if (!changed) break;
        q = q_before;
        v = v_before;
    }
    q = q_before;
    v = v_before;
    return false;
}

}  // namespace pn
