#include "friction/rest_motions.hpp"

#include <algorithm>
#include <cmath>

#include "complementarity/load_dependent/enumeration.hpp"
#include "complementarity/load_dependent/solver.hpp"
#include "dynamics/implicit_friction.hpp"

namespace pn {

namespace {

bool sticks_more(const std::vector<bool>& one, const std::vector<bool>& other) {
    for (size_t i = 0; i < one.size(); ++i)
        if (other[i] && !one[i]) return false;
    return one != other;
}

}  // namespace

// Solve for the forces of all elements for the current factors of their limits and one zero-load set. For a few elements,
// select among all motions. For more elements, return the motion in which all stick, else any motion.
bool RestMotions::find_in_zero_load_set(RestProblem& problem, VecX& x) {
    const RestEquation& equation = problem.equation;
    const AllMotions all = all_motions(equation);
    if (all.complete && !problem.has_zero_load_sets()) {
        std::vector<VecX> motions;
        for (const VecX& forces : all.forces)
            if (problem.is_motion(forces)) motions.push_back(forces);
        // If a contact has tension in all motions, it is about to open.
        return choose(problem, motions.empty() ? all.forces : motions, x);
    }
    VecX holding = equation.holding_forces();
    if (!refine_rest(equation, holding) || !all_stick(equation, holding)) return solve_rest(equation, x);
    x = holding;
    return true;
}

bool RestMotions::find(RestProblem& problem, VecX& x) {
    for (int turn = 0; turn < implicit_friction_parameters.max_zero_load_sets && find_in_zero_load_set(problem, x); ++turn) {
        if (!problem.has_zero_load_sets() || problem.is_motion(x)) return true;
        problem.freeze_zero_loads(x);
    }
    return false;
}

bool RestMotions::refine(RestProblem& problem, VecX& x) {
    for (int turn = 0; turn < implicit_friction_parameters.max_zero_load_sets; ++turn) {
        if (problem.has_zero_load_sets()) problem.freeze_zero_loads(x);
        if (!refine_rest(problem.equation, x)) return false;
        if (!problem.has_zero_load_sets() || problem.is_motion(x)) return true;
    }
    return false;
}

bool RestMotions::hold(RestProblem& problem, VecX& x) {
    const auto begin = problem.equation.elements.begin();
    const auto may_stick = [](const RestElement& e) { return e.may_stick; };  // the constraints drive the others
    if (!std::all_of(begin, begin + list_.size(), may_stick)) return false;
    x = problem.equation.holding_forces();
    for (int turn = 0; turn < implicit_friction_parameters.max_zero_load_sets; ++turn) {
        const bool holds = hold_at_rest(problem.equation, x);
        if (!problem.has_zero_load_sets() || problem.is_motion(x)) return holds;
        problem.freeze_zero_loads(x);
    }
    return false;
}

// Select the motion in which all elements stick that stick in any other motion. Elements at rest stay at rest.
bool RestMotions::choose(const RestProblem& problem, const std::vector<VecX>& motions, VecX& x) {
    const RestEquation& equation = problem.equation;
    complete_ = true;
    if (motions.empty()) return false;
    for (const VecX& one : motions) {
        const bool stickiest = std::all_of(motions.begin(), motions.end(), [&](const VecX& other) {
            return &other == &one || sticks_more(equation.sticks(one), equation.sticks(other));
        });
        if (!stickiest) continue;
        w.now.several = motions.size() > 1;
        w.now.several_element = list_.front();
        x = one;
        return true;
    }
    double determinant = HUGE_VAL;
    for (const VecX& one : motions) determinant = std::min(determinant, equation.determinant(one));
    paradox(problem, determinant, motions);
}

void RestMotions::paradox(const RestProblem& problem, double determinant, const std::vector<VecX>& motions) const {
    Failure failure(Failure::Kind::paradox, t_, list_, determinant);
    failure.solutions = motions.empty() ? Failure::Solutions::none : Failure::Solutions::several;
    for (size_t i = 0; i < std::min<size_t>(2, motions.size()); ++i) {
        VecX alpha;
        FrictionLimits limits;
        problem.equation.respond(motions[i], alpha, limits);
        failure.limits.push_back(limits.size.head(list_.size()));
        failure.accelerations.push_back(problem.acceleration(motions[i]));
    }
    throw failure;
}

bool RestMotions::all_stick(const RestEquation& equation, const VecX& x) const {
    const std::vector<bool> sticks = equation.sticks(x);
    return std::all_of(sticks.begin(), sticks.begin() + list_.size(), [](bool one) { return one; });
}

}  // namespace pn
