// Edges and rims that approach others in time stepping. Their normals are defined up to a penetration of their rounding
// radius, so steps end earlier.
#pragma once

#include <vector>

#include "run/events/gap_watch.hpp"

namespace pn {

struct ApproachingEdgesParameters {
    // Maximum penetration of edges and rims with a defined normal, relative to their rounding radius.
    double nearly_all = 0.999;
};

class ApproachingEdges {
public:
    using Parameters = ApproachingEdgesParameters;
    static constexpr Parameters parameters{};

    ApproachingEdges(System& system, const GapWatch& watch);

    // Return the longest step from y at t, up to h. Approaching edges and rims may penetrate by half of their rounding
    // radius. If they already penetrate, the middle of the step may reach half of the remaining rounding radius. Deeper
    // edges and rims have no defined normal, and may pass through each other.
    double allowed(double t, double h, const VecX& y);
    // Check if such an edge or rim has lost its normal since the call of `allowed`, at the end y of a step, at t. An impact
    // inside the step may turn a body toward it.
    bool pass(double t, const VecX& y);
    // Check if the normal of a gap is defined at this width.
    bool has_known_direction(int gap, double width) const;

private:
    System& system_;
    const Program& p;
    Workspace& w;
    const GapWatch& watch_;
    std::vector<double> rounded_by_;  // maximum penetration of each gap with a defined normal, infinite for planes
    bool rounded_ = false;            // a gap has a finite maximum
    std::vector<int> near_;           // gaps of edges and rims with a normal that a step may reach
};

}  // namespace pn
