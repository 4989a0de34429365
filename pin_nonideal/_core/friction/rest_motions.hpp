// Motions of elements at rest whose friction limits depend on loads: search, and choice if there are several.
#pragma once

#include <vector>

#include "friction/load_dependent_problem.hpp"

namespace pn {

class RestMotions {
public:
    // `resting`: the elements at rest.
    RestMotions(const Program& program, Workspace& workspace, double t, const std::vector<int>& resting)
        : p(program), w(workspace), t_(t), list_(resting) {}

    // Solve for one zero-load set after the other until the motion is consistent with its own set. Return false if no
    // motion was found. Throw a paradox if all motions are known, and no motion has the sticking elements of every motion.
    bool find(RestProblem& problem, VecX& x);
    // Refine by Newton's method alone, near a solution.
    bool refine(RestProblem& problem, VecX& x);
    // Check if forces x within their limits hold all elements at rest, for any zero-load set, although an iteration
    // found slip.
    bool hold(RestProblem& problem, VecX& x);
    // Throw a paradox with the forces of possible motions in `motions`, and store two of them.
    [[noreturn]] void paradox(const RestProblem& problem, double determinant, const std::vector<VecX>& motions) const;
    // Check if a search has found all motions.
    bool are_complete() const { return complete_; }

private:
    bool find_in_zero_load_set(RestProblem& problem, VecX& x);
    bool choose(const RestProblem& problem, const std::vector<VecX>& motions, VecX& x);
    bool all_stick(const RestEquation& equation, const VecX& x) const;

    const Program& p;
    Workspace& w;
    const double t_;
    const std::vector<int>& list_;
    bool complete_ = false;
};

}  // namespace pn
