// Coupled friction problem of some elements. With their forces f as unknowns, slip accelerations are alpha = alpha0 + W
// f. W is the Delassus matrix of the elements' directions under the constraints in use.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct FrictionProblemParameters {
    double min_pivot = 1e-10;  // pivot of the scaled W below which forces depend on each other
};

struct FrictionProblem {
    using Parameters = FrictionProblemParameters;
    static constexpr Parameters parameters{};

    std::vector<int> elements, dims;  // element i has dims[i] consecutive rows of alpha and f
    int rows = 0;
    VecX alpha0;  // without any friction of these elements
    MatX W;       // alpha for a unit of each friction force
    MatX response, multipliers;   // a and lam for a unit of each friction force
    VecX free;                    // squared scaled response to each force without constraints
    VecX unit, force, lam, none;  // work arrays

    // Set up the problem for the factors in the workspace. These elements do not stick there. The caller sets alpha0.
    FrictionProblem(const Program& p, Workspace& w, std::vector<int> elements);
    // Check if the accelerations determine the forces, except along directions that the constraints hold.
    bool has_unique_forces() const;

    // Compute the rows A x of the elements' directions.
    VecX along(const Program& p, Workspace& w, const VecX& x) const;
    // Slip accelerations A a - b of the current motion.
    VecX slip_accelerations(const Program& p, Workspace& w) const;
    // Add A^T f to C and store each element's part of f as its slip force.
    void add_forces(const Program& p, Workspace& w, const VecX& f, VecX& C) const;
    // Restore exact properties of W: symmetry, and zeros for directions that the constraints determine, such as the
    // friction of a driven joint.
    void clean(const Program& p, Workspace& w);
    // Set alpha0 to zero where the constraints hold a direction and alpha0 is rounding error of the accelerations that they
    // prevent.
    void unload_held(const Program& p, Workspace& w);

private:
    template <class Act>
    void each_unit_force(const Program& p, const Workspace& w, const Act& act);
};

}  // namespace pn
