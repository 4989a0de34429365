#include "run/time_stepping/step_elements.hpp"

#include <algorithm>
#include <cmath>

#include "contact/impact.hpp"
#include "contact/queries.hpp"
#include "dynamics/friction_limit.hpp"
#include "friction/stick_slip.hpp"
#include "tree/terms.hpp"

namespace pn {

StepElements::StepElements(const Program& p) {
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e)
        if (p.frictions[e].gap < 0) outside_contacts_.push_back(e);
    const int most = p.layout.rows;
    rows.reserve(most);
    parts.reserve(most);
    cones.reserve(most);
    rubbing_.reserve(p.frictions.size());
}

// Return the coefficient of a contact: the static one if it sticks or comes to rest.
double StepElements::coefficient(const Program& p, const Workspace& w, const Part& part) const {
    const Friction& friction = p.frictions[part.element];
    return part.rests ? friction.holding_limit(friction.mu)
                      : friction.kinetic_limit(friction.mu, slip_velocity(w.now, friction).norm());
}

void StepElements::add(const Program& p, const Part& part, int block, int kept, const ConeElement& cone) {
    for (int k = 0; k < kept; ++k) rows.push_back({block, k});
    if (part.gap >= 0 && part.element >= 0) {
        const int slip = p.frictions[part.element].block;
        for (size_t k = 0; k < p.blocks[slip].kept.size(); ++k) rows.push_back({slip, static_cast<int>(k)});
    }
    parts.push_back(part);
    cones.push_back(cone);
}

void StepElements::gather(const Program& p, Workspace& w, const std::vector<int>& touching,
                          const std::vector<char>& closed, const std::vector<Mode>& modes,
                          const std::vector<int>& loaded, const MeanVelocity& mean) {
    rows.clear();
    parts.clear();
    cones.clear();
    rubbing_ = outside_contacts_;
    const double still = rest_rate(mean.start());
    for (int i : touching) {
        const Gap& gap = p.gaps[i];
        const int slides = gap.sliding < 0 ? 0 : static_cast<int>(p.blocks[p.frictions[gap.sliding].block].kept.size());
        const bool bears = std::binary_search(loaded.begin(), loaded.end(), gap.block);
        Part part{i, gap.sliding, bears ? 0.0 : gap.restitution * std::min(0.0, gap_rate(p, w, i))};
        part.rests = gap.sliding >= 0 && (modes[gap.sliding] == sticking ||
                                          slip_velocity(w.now, p.frictions[gap.sliding]).norm() <= still);
        part.strikes = !closed[i];
        const double mu = gap.sliding < 0 ? 0.0 : coefficient(p, w, part);
        add(p, part, gap.block, 1, ConeElement::contact(1 + slides, mu));
        for (int e : gap.elements)
            if (e != gap.sliding) rubbing_.push_back(e);
    }
    std::sort(rubbing_.begin(), rubbing_.end());
    for (int e : rubbing_) {
        const int block = p.frictions[e].block, kept = static_cast<int>(p.blocks[block].kept.size());
        Part part{-1, e};
        const bool is_still = p.frictions[e].gap < 0 ? mean.starts_at_rest(p, w, p.frictions[e])
                                                     : slip_velocity(w.now, p.frictions[e]).norm() <= still;
        part.rests = modes[e] == sticking || is_still;
        if (kept > 0) add(p, part, block, kept, ConeElement::box(kept, 0.0));
    }
}

void StepElements::move(const Program& p, const Workspace& w) {
    for (size_t e = 0; e < parts.size(); ++e)
        if (parts[e].gap >= 0 && parts[e].element >= 0) cones[e].bound = coefficient(p, w, parts[e]);
}

bool StepElements::limits_follow_loads(const Program& p) const {
    return std::any_of(rubbing_.begin(), rubbing_.end(), [&](int e) {
        return p.frictions[e].gap >= 0 || p.frictions[e].load != Friction::Load::none;
    });
}

// Return the limits of a box under the loads of the current motion.
SlipLimits StepElements::limits(const Program& p, Workspace& w, double t, const MeanVelocity& mean, size_t e) const {
    const Friction& friction = p.frictions[parts[e].element];
    const double speed = slip_velocity(w.now, friction).norm();
    const SlipLimits load = friction.gap >= 0 ? SlipLimits(friction.constant + friction.mu * w.now.lam[friction.row])
                                              : load_limits(p, w, friction, t, w.now.terms.q, mean.value());
    return load * (parts[e].rests ? friction.static_ratio : friction.speed_factor(speed));
}

bool StepElements::may_give_way(const Program& p) const {
    return std::any_of(parts.begin(), parts.end(), [&](const Part& part) {
        return part.rests && p.frictions[part.element].static_ratio != 1.0;
    });
}

bool StepElements::give_way(const Program& p, const Workspace& w, const VecX& f, const VecX& slips, double clear,
                            double still) {
    bool changes = false;
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        Part& part = parts[e];
        if (!part.rests || p.frictions[part.element].static_ratio == 1.0) continue;
        if (limit_left(e, static_cast<int>(at), f) > clear) continue;
        const int head = part.gap >= 0;
        if (slips.segment(at + head, cones[e].dim - head).norm() <= still) continue;
        part.rests = false;
        changes = true;
        if (head) cones[e].bound = coefficient(p, w, part);
    }
    return changes;
}

double StepElements::limit_left(size_t e, int at, const VecX& f) const {
    const int head = parts[e].gap >= 0, dim = cones[e].dim - head;
    const double size = dim == 1 ? std::abs(f[at + head] - parts[e].middle) : f.segment(at + head, dim).norm();
    return cones[e].bound * (head ? f[at] : 1.0) - size;
}

bool StepElements::limits_settle(const Program& p, Workspace& w, double t, const MeanVelocity& mean, double allowed) {
    double change = 0.0, largest = 0.0;
    from_.clear();
    to_.clear();
    for (size_t e = 0; e < parts.size(); ++e) {
        if (!cones[e].is(ConeElement::Kind::box)) continue;
        const SlipLimits now = limits(p, w, t, mean, e);
        const double limit = now.reach();
        change = std::max({change, std::abs(limit - cones[e].bound), std::abs(now.middle() - parts[e].middle)});
        largest = std::max(largest, limit);
        from_.insert(from_.end(), {cones[e].bound, parts[e].middle});
        to_.insert(to_.end(), {limit, now.middle()});
        cones[e].bound = std::max(0.0, limit);
        parts[e].middle = now.middle();
    }
    const bool settles = change <= parameters.load_tolerance * largest ||
                         (change > parameters.max_load_contraction * last_change_ && change <= allowed);
    last_change_ = change;
    return settles;
}

void StepElements::accelerate_limits() {
    const auto size = static_cast<Eigen::Index>(from_.size());
    const VecX next = loads_.next(VecX::Map(from_.data(), size), VecX::Map(to_.data(), size));
    for (size_t e = 0, at = 0; e < parts.size(); ++e) {
        if (!cones[e].is(ConeElement::Kind::box)) continue;
        cones[e].bound = std::max(0.0, next[at++]);
        parts[e].middle = next[at++];
    }
}

void StepElements::reduce_limits() {
    for (ConeElement& cone : cones)
        if (cone.is(ConeElement::Kind::box)) cone.bound *= parameters.kept_limit;
}

bool StepElements::limits_hold(const Program& p, Workspace& w, double t, const MeanVelocity& mean, const VecX& f) {
    bool hold = true;
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e) {
        if (!cones[e].is(ConeElement::Kind::box)) continue;
        const SlipLimits now = limits(p, w, t, mean, e);
        const int dim = cones[e].dim;
        const double size = dim == 1 ? std::abs(f[at] - now.middle()) : f.segment(at, dim).norm();
        cones[e].bound = std::max(0.0, now.reach());
        parts[e].middle = now.middle();
        hold &= size <= cones[e].bound;
    }
    return hold;
}

void StepElements::middles(VecX& f) const {
    f.head(static_cast<Eigen::Index>(rows.size())).setZero();
    for (size_t e = 0, at = 0; e < parts.size(); at += cones[e].dim, ++e)
        if (parts[e].middle != 0.0) f[at] = parts[e].middle;
}

}  // namespace pn
