#include "friction/mode_enumeration.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics/reactions.hpp"
#include "dynamics/friction_limit.hpp"
#include "dynamics/step_start.hpp"

namespace pn {

namespace {

constexpr int max_enumerated_elements = 5;  // 243 choices, each with one implicit equation

bool may_be_tried(const Program& p, const std::vector<int>& list) {
    return list.size() <= max_enumerated_elements &&
           std::all_of(list.begin(), list.end(), [&](int e) { return p.frictions[e].dim == 1; });
}

struct ModeEnumeration {
    const Program& p;
    Workspace& w;
    double t;
    const VecX &q, &v;
    const ModeQuery& query;
    std::vector<std::vector<Mode>> motions;  // modes whose motions satisfy the conditions of these modes
    bool shown = true;                       // true if all other modes are proven to have no motion
    double determinant = 0.0;                // smallest determinant of the modes without a motion

    // Decode `number` into modes: each element sticks or slips in either direction. Return false if an element at its
    // limit sticks.
    bool choose(int number, std::vector<Mode>& modes) const {
        for (int e : query.at_rest) {
            modes[e] = number % 3 == 0 ? sticking : number % 3 == 1 ? slip_plus : slip_minus;
            number /= 3;
            const auto& at_limit = query.at_limit;
            if (modes[e] == sticking && std::find(at_limit.begin(), at_limit.end(), e) != at_limit.end()) return false;
        }
        return true;
    }

    void move(const std::vector<Mode>& modes) {
        set_modes(p, w, modes);
        w.state.warm = false;
        w.state.steps_since = undecided_steps;
        begin_step(p, w, t, q, v);
    }

    // Check if the current motion satisfies the conditions of its modes, up to rounding.
    bool keeps_conditions() {
        const double size = w.now.a.cwiseAbs().maxCoeff() + p.mechanism.gravity.norm();
        return std::all_of(query.at_rest.begin(), query.at_rest.end(), [&](int e) {
            if (w.state.mode[e] != sticking)
                return slip_rate_along_mode(p, w, e) >= -slip_onset_parameters.condition_slack * size;
            return holding_force(p, w, e, t, q, v).is_within(slip_onset_parameters.condition_slack);
        });
    }

    void try_all() {
        std::vector<Mode> modes = query.modes;
        const int choices = static_cast<int>(std::lround(std::pow(3.0, query.at_rest.size())));
        for (int number = 0; number < choices; ++number) {
            if (!choose(number, modes)) continue;
            if (const auto failure = attempt([&] { move(modes); })) {
                shown &= failure->solutions == Failure::Solutions::none;
                if (failure->kind == Failure::Kind::paradox) determinant = std::min(determinant, failure->value);
                continue;
            }
            if (keeps_conditions()) motions.push_back(modes);
            else shown &= w.state.unique == Uniqueness::shown;
        }
    }

    const std::vector<Mode>* stickiest() const {
        const auto holds_all_of = [&](const std::vector<Mode>& one, const std::vector<Mode>& other) {
            return std::all_of(query.at_rest.begin(), query.at_rest.end(),
                               [&](int e) { return one[e] == sticking || other[e] != sticking; });
        };
        for (const std::vector<Mode>& one : motions)
            if (std::all_of(motions.begin(), motions.end(), [&](const auto& other) { return holds_all_of(one, other); }))
                return &one;
        return nullptr;
    }

    [[noreturn]] void paradox() {
        Failure failure(Failure::Kind::paradox, t, query.at_rest, determinant);
        failure.solutions = motions.empty() ? Failure::Solutions::none : Failure::Solutions::several;
        for (size_t i = 0; i < std::min<size_t>(2, motions.size()); ++i) {
            move(motions[i]);
            VecX limits(query.at_rest.size());
            for (int k = 0; k < limits.size(); ++k)
                limits[k] = static_limits(p, w, query.at_rest[k], t, q, v).reach();
            failure.limits.push_back(limits);
            failure.accelerations.push_back(w.now.a);
        }
        throw failure;
    }
};

}  // namespace

bool enumerate_modes(const Program& p, Workspace& w, double t, const VecX& q, const VecX& v,
                     const ModeQuery& query) {
    if (!may_be_tried(p, query.at_rest)) return false;
    ModeEnumeration each{p, w, t, q, v, query, {}};
    each.try_all();
    if (each.motions.empty() && !each.shown) return false;
    const std::vector<Mode>* modes = each.stickiest();
    if (!modes) each.paradox();
    each.move(*modes);
    w.now.several = each.motions.size() > 1;
    w.now.several_element = query.at_rest.front();
    return true;
}

}  // namespace pn
