#include "friction/mode_query.hpp"

#include <algorithm>

#include "dynamics/evaluation.hpp"
#include "dynamics/friction_limit.hpp"
#include "math/tolerances.hpp"

namespace pn {

static bool has_negligible_slip(const Program& p, const Workspace& w, int e, const VecX& v) {
    return slip_velocity(w.now, p.frictions[e]).norm() <= rest_speed * (1.0 + v.cwiseAbs().maxCoeff());
}

bool at_rest(const Program& p, const Workspace& w, int e, const VecX& v) {
    return w.state.mode[e] == sticking || has_negligible_slip(p, w, e, v);
}

void follow_velocity(const Program& p, Workspace& w, int e, ModeQuery& query) {
    const Vec3 u = slip_velocity(w.now, p.frictions[e]);
    query.modes[e] = p.frictions[e].dim > 1 || u[0] > 0.0 ? slip_plus : slip_minus;
    if (p.frictions[e].dim > 1) w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
}

void follow_slip(const Program& p, Workspace& w, const VecX& v, const std::vector<int>& at_rest) {
    const double min_speed = min_directed_speed * (1.0 + v.cwiseAbs().maxCoeff());
    for (int e : w.now.slipping) {
        if (p.frictions[e].dim == 1 || std::find(at_rest.begin(), at_rest.end(), e) != at_rest.end()) continue;
        const Vec3 u = slip_velocity(w.now, p.frictions[e]);
        if (u.norm() > min_speed) w.state.slip_direction[e] = w.state.last_direction[e] = u.normalized();
    }
}

void follow_projection(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                       const std::vector<int>& at_rest) {
    if (!w.state.solves_directions) return;
    update_kinematics(p, w, t, q, v);
    follow_slip(p, w, v, at_rest);
}

ModeQuery make_mode_query(const Program& p, Workspace& w, const VecX& v, int also) {
    ModeQuery mode_query{w.state.mode, {}, {}};
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (is_open(p, w, e)) continue;
        if (e != also && !at_rest(p, w, e, v) && !w.state.is_sticking_deferred[e]) {
            follow_velocity(p, w, e, mode_query);
            continue;
        }
        mode_query.at_rest.push_back(e);
        if (e == also) mode_query.modes[e] = sticking;
    }
    return mode_query;
}

ModeQuery make_first_mode_query(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    ModeQuery mode_query{w.state.mode, {}, {}};
    if (p.frictions.empty()) return mode_query;
    w.state.warm = false;
    update_kinematics(p, w, t, q, v);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (is_open(p, w, e)) continue;
        mode_query.modes[e] = sticking;
        if (has_negligible_slip(p, w, e, v)) mode_query.at_rest.push_back(e);
        else follow_velocity(p, w, e, mode_query);
    }
    return mode_query;
}

}  // namespace pn
