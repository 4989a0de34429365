// Depenetration after a step if not all closed contacts can lie on their planes. An example is a can that lands tilted:
// its rim is set back from points of its face.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct DepenetrationParameters {
    // Moves longer than this many times the longest single-contact move do not resolve all penetrations.
    double max_move_ratio = 10.0;
    int max_steps = 20;  // Newton-like steps, each much shorter than the last one
};

inline constexpr DepenetrationParameters depenetration_parameters{};

// Length of the longest move, in the metric of M, that brings a single closed contact onto its plane.
double longest_single_move(const Program& p, const Workspace& w);
// Check if projection left closed contacts off their planes, or moved much farther than `longest_single` because planes
// are nearly parallel.
bool left_planes(const Program& p, Workspace& w, double longest_single);

// Move q by the least move in the metric of M to a position that satisfies the constraints. At this position gaps are
// nonnegative and complementary to compressive multipliers. Contacts that do not touch at this position open. If no
// such position is found, q is only projected onto the constraints, and contacts off their planes open. On return the
// workspace is configured at q, with independent rows. Return true if rows were chosen.
bool depenetrate(const Program& p, Workspace& w, double t, VecX& q, const VecX& v);

}  // namespace pn
