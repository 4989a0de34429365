#include "friction/mode_update.hpp"

#include <optional>

#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

namespace {

// Change the modes whose conditions fail in the current motion. An element past its limit slips, and an element driven
// against its slip sticks. Return the number of changes. Return nothing if one motion does not decide, for elements of
// several directions or redundant sticking elements.
std::optional<int> update_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                const std::vector<int>& at_rest, std::vector<Mode>& modes) {
    const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
    int changed = 0;
    for (int e : at_rest) {
        if (modes[e] == sticking) {
            const HoldingForce held = holding_force(p, w, e, t, q, v);
            if (held.is_within(mode_update_parameters.condition_slack)) continue;
            if (p.frictions[e].dim > 1 || w.now.rows.redundant) return std::nullopt;
            modes[e] = held.force[0] < 0.0 ? slip_plus : slip_minus;
        } else {
            if (slip_rate_along_mode(p, w, e) >= -mode_update_parameters.condition_slack * size) continue;
            modes[e] = sticking;
        }
        ++changed;
    }
    return changed;
}

}  // namespace

bool try_previous_modes(const Program& p, Workspace& w, double t, VecX& q, VecX& v, const ModeQuery& query,
                        int element) {
    const bool breaks = !query.at_limit.empty();
    // An element starts to slip alone only if no other rows hold the same freedom.
    const bool alone = p.frictions[element].dim == 1 && query.at_limit.size() == 1 && !w.now.rows.redundant;
    if (p.needs_reactions || (breaks && !alone)) return false;
    std::vector<Mode> modes = query.modes;
    for (int e : query.at_rest) modes[e] = sticking;
    if (breaks) modes[element] = holding_force(p, w, element, t, q, v).force[0] < 0.0 ? slip_plus : slip_minus;
    const VecX q_before = q, v_before = v;
    const double max_change = mode_update_parameters.min_velocity_change * (1.0 + v_before.cwiseAbs().maxCoeff());
    for (int round = 0; round < mode_update_parameters.max_rounds; ++round) {
        set_modes(p, w, modes);
        bool keeps_velocity = false;
        const auto failure = attempt({Failure::Kind::inconsistent}, [&] {
            project_into_modes(p, w, t, q, v);
            keeps_velocity = !((v - v_before).cwiseAbs().maxCoeff() > max_change);
            if (!keeps_velocity) return;
            follow_projection(p, w, t, q, v, query.at_rest);
            begin_step(p, w, t, q, v);
        });
        if (failure || !keeps_velocity) break;
        const std::optional<int> changed = update_modes(p, w, t, q, v, query.at_rest, modes);
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
