#include "contact/onset.hpp"

#include <algorithm>

#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"
#include "contact/rest_of_trees.hpp"
#include "friction/stick_slip.hpp"

namespace pn {

namespace {

constexpr int many = 8;  // minimum number of contacts for a first search without the matrix of responses

// Check if the cone problem applies. All friction must be sliding of contacts that grows from zero with the load, or have
// a constant limit. No user law may depend on reactions.
bool fits(const Program& p) {
    bool known = true;
    each_law<UserLaw>(p.laws, [&](const UserLaw& law) { known &= law.reaction == Reaction::none; });
    for (size_t e = 0; e < p.frictions.size(); ++e) {
        const Friction& f = p.frictions[e];
        const bool slides = f.gap >= 0 && p.gaps[f.gap].sliding == static_cast<int>(e) && f.constant == 0.0;
        const bool is_constant = f.gap < 0 && f.reaction == Reaction::none && f.mu == 0.0 && !f.user_limit;
        known &= (slides || is_constant) && static_cast<int>(p.blocks[f.block].kept.size()) == f.dim;
    }
    return known;
}

// Check if all contacts rest, and forces of the laws at rest hold them. Small problems are not tested, because the cone
// problem decides them fast enough.
bool rests_at_once(const Program& p, Workspace& w, const VecX& v, const OnsetQuery& query,
                   const std::vector<int>& gaps, const std::vector<int>& others) {
    if (static_cast<int>(gaps.size()) < many || !query.at_limit.empty() || p.moves_in_time) return false;
    if ((v.array() != 0.0).any()) return false;
    std::vector<ConeElement> cones;
    for (int gap : gaps) {
        const int e = p.gaps[gap].sliding;
        if (e < 0) cones.push_back(ConeElement::contact(1, 0.0));
        else cones.push_back(ConeElement::contact(1 + p.frictions[e].dim, p.frictions[e].holding_limit(p.frictions[e].mu)));
    }
    for (int e : others)
        cones.push_back(ConeElement::box(p.frictions[e].dim, p.frictions[e].holding_limit(p.frictions[e].constant)));
    return rest_on_trees(p, w, gaps, others, cones);
}

// Call act(problem) with the contacts of `query.rest` and the other elements at rest as a cone problem, or
// rest(elements) if they rest at once. The workspace is unchanged afterwards. Return false if no contact rests, if an
// element has a law without a cone or slips in several directions, or if the constraints admit no motion without these
// contacts.
template <class Rest, class Act>
bool with_problem(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const OnsetQuery& query,
                  const Rest& rest, const Act& act) {
    std::vector<int> gaps;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i)
        if (query.rest[i]) gaps.push_back(i);
    if (gaps.empty() || !fits(p)) return false;
    const RunState before = w.state;
    std::vector<int> others;  // at rest
    std::vector<Mode> modes(p.frictions.size(), unloaded);
    for (int e = 0; e < static_cast<int>(p.frictions.size()); ++e) {
        if (p.frictions[e].gap >= 0) continue;
        if (is_at_rest(p, w, v, query, before, e)) others.push_back(e);
        else if (p.frictions[e].dim > 1) return false;
        else modes[e] = slip_velocity(w.now, p.frictions[e])[0] > 0.0 ? slip_plus : slip_minus;
    }
    bool has_motion = false;
    attempt([&] {  // the caller's own evaluation reports failures of other rows
        release_contacts(p, w, t, q, v, query.rest, modes);
        if (rests_at_once(p, w, v, query, gaps, others)) {
            rest(others);
            has_motion = true;
        } else {
            RestingProblem problem(p, w, v, gaps, others, query, before);
            has_motion = act(problem);
        }
    });
    set_closed(p, w, before.closed);
    set_modes(p, w, before.mode);
    w.state = before;
    return has_motion;
}

}  // namespace

std::optional<OnsetMotion> onset_motion(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                                        const OnsetQuery& query) {
    const std::vector<char> open(p.gaps.size(), 0);
    OnsetMotion out{open, std::vector<Mode>(p.frictions.size(), unloaded),
                    std::vector<Vec3>(p.frictions.size(), Vec3::Zero()), {}};
    out.friction = out.direction;
    const auto rest = [&](const std::vector<int>& others) {
        out.closed = query.rest;
        for (size_t i = 0; i < p.gaps.size(); ++i)
            if (query.rest[i] && p.gaps[i].sliding >= 0) out.modes[p.gaps[i].sliding] = sticking;
        for (int e : others) out.modes[e] = sticking;
        out.shared = true;
    };
    const bool has_motion = with_problem(p, w, t, q, v, query, rest, [&](RestingProblem& problem) {
        if (!problem.solve(out.shared)) return false;
        problem.read(out);
        out.several = problem.several;
        return true;
    });
    if (!has_motion) return std::nullopt;
    return out;
}

bool is_choice_unique(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v, const OnsetQuery& query) {
    int rough = 0, resting = 0;
    for (int i = 0; i < static_cast<int>(p.gaps.size()); ++i) {
        const int e = p.gaps[i].sliding;
        if (!query.rest[i] || e < 0) continue;
        ++rough;
        resting += is_at_rest(p, w, v, query, w.state, e);
    }
    if (rough < 2 || resting == 0) return true;
    bool is_proven = false;
    with_problem(p, w, t, q, v, query, [](const std::vector<int>&) {}, [&](const RestingProblem& problem) {
        return is_proven = problem.has_one_motion();
    });
    return is_proven;
}

bool closed_contacts_hold(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v) {
    OnsetQuery query;
    query.rest = w.state.closed;
    return with_problem(p, w, t, q, v, query, [](const std::vector<int>&) {}, [](RestingProblem& problem) {
        ConeComplementarity solver;
        return problem.hold(solver);
    });
}

}  // namespace pn
