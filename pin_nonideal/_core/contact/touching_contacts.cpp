#include "contact/touching_contacts.hpp"

#include <algorithm>

#include "contact/queries.hpp"
#include "dynamics/evaluation.hpp"
#include "math/tolerances.hpp"

namespace pn {

TouchingContacts touching_contacts(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, bool starts) {
    TouchingContacts out{std::vector<char>(p.gaps.size(), 0), std::vector<char>(p.gaps.size(), 0)};
    update_kinematics(p, w, t, q, v);
    const double width = starts ? touching_contacts_parameters.starting_width * scene_size(p, w) : touching_width;
    std::vector<int> list;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        if (is_bare(p, i)) continue;
        if (!w.state.closed[i] && !p.is_users(i)) {
            if (measured_width(p, w, t, v, i) > touching_contacts_parameters.sure_gap) continue;
        }
        evaluate_gap(p, w, t, v, i);
        const bool touches =
            gap_width(p, w, i) <= std::max(width, -gap_rate(p, w, i) * touching_contacts_parameters.touching_time);
        if (w.state.closed[i] || touches) list.push_back(i);
    }
    if (list.size() > 1) {
        for (int i : list)
            if (p.gaps[i].sliding >= 0) evaluate_block(p, w, t, v, p.frictions[p.gaps[i].sliding].block);
        remove_coincident(p, w, list, [&](int i, int other) {
            if (opens_later(p, w, i, other) || opens_later(p, w, other, i)) return opens_later(p, w, i, other);
            return w.state.closed[i] && !w.state.closed[other];
        });
    }
    const double still = rest_rate(v);
    for (int i : list) {
        const double rate = gap_rate(p, w, i);
        out.touch[i] = 1;
        out.rest[i] = rate <= still;
        out.strikes |= rate < -still;
        out.lands |= rate < -still && !w.state.closed[i];
    }
    return out;
}

const TouchingContacts& TouchingCache::at(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                          bool starts) {
    const bool same = is_set_ && t == t_ && starts == starts_ && q == q_ && v == v_ && same_bytes(closed_, w.state.closed);
    if (same) return found_;
    is_set_ = true;
    t_ = t;
    starts_ = starts;
    q_ = q;
    v_ = v;
    closed_ = w.state.closed;
    found_ = touching_contacts(p, w, t, q, v, starts);
    return found_;
}

}  // namespace pn
