// Where W does not tell how contacts share a load: of the forces with the same w, the shortest that the cones allow.
#pragma once

#include "complementarity/cone/problem.hpp"

namespace pn {

class ConeShares {
public:
    // f, a solution, becomes the one of least norm in the units it had before scaling. With E an orthonormal basis of
    // the forces that W tells apart it is f = P(E y) with E^T f unchanged, P the nearest point of what the modes of w
    // leave: a cone where nothing moves, a ray where it slips. False if y was not found, and f is as it was.
    bool even_out(const ConeProblem& problem, Eigen::Ref<VecX> f);

private:
    int span(const ConeProblem& problem);
    void project(const ConeProblem& problem, const Eigen::Ref<const VecX>& z, Eigen::Ref<VecX> f, bool differentiate);
    double miss(const ConeProblem& problem, const Eigen::Ref<const VecX>& y, int rank);

    DenseSolver solver_;
    Buffer basis_, transpose_, D_, DE_, J_, y_, ahead_, step_, told_, miss_, z_, g_, w_, given_;
};

}  // namespace pn
