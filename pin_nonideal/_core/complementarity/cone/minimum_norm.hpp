// Minimum-norm forces of contacts that share a load. If W does not determine the shares, these are the shortest forces
// in the cones with the same w.
#pragma once

#include "complementarity/cone/problem.hpp"

namespace pn {

struct MinimumNormForcesParameters {
    double rest_velocity = 1e-9;     // w below this fraction of the largest w0 counts as zero
    double tolerance = 3e-15;        // relative to the forces
    double stall_tolerance = 1e-12;  // accepted residual if steps make no progress
    double damping = 1e-10;          // damping of Newton's method, relative to the residual
    int max_steps = 60;              // maximum Newton steps
    int max_halvings = 10;           // maximum halvings of a step that does not reduce the residual
};

class MinimumNormForces {
public:
    using Parameters = MinimumNormForcesParameters;
    static constexpr Parameters parameters{};

    // Replace f, a solution, by the one of minimum norm in the units before scaling. E is an orthonormal basis of the
    // forces that W distinguishes. The result is f = P(E y) with E^T f unchanged. P projects on the set that the modes
    // of w allow: a cone if nothing moves, a ray if the contact slips. Return false, with f unchanged, if y was not found.
    bool minimize_norm(const ConeProblem& problem, Eigen::Ref<VecX> f);

private:
    int span(const ConeProblem& problem);
    void project(const ConeProblem& problem, const Eigen::Ref<const VecX>& z, Eigen::Ref<VecX> f, bool differentiate);
    double miss(const ConeProblem& problem, const Eigen::Ref<const VecX>& y, int rank);

    DenseSolver solver_;
    Buffer basis_, transpose_, D_, DE_, J_, y_, ahead_, step_, target_, miss_, z_, g_, w_, given_;
};

}  // namespace pn
