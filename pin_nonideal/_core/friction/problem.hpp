// The friction problem of some elements together: with their forces f as unknowns, slip accelerations are
// alpha = alpha0 + W f, W the Delassus matrix of their directions after the constraints in use.
#pragma once

#include "dynamics/workspace.hpp"

namespace pn {

struct FrictionProblem {
    std::vector<int> elements, dims;  // dims[i] rows of alpha and f for element i, one after the other
    int rows = 0;
    VecX alpha0;       // without any friction of these elements
    MatX W;            // alpha for a unit of each friction force
    MatX response, multipliers;  // a and lam for it
    VecX free;                   // square of what each force would cause if no constraint held, by the scaled response
    VecX unit, force, lam, none;  // work
    bool scaled = false;         // the response is a_s = R^T a

    // For the factors in the workspace, in which these elements do not stick; alpha0 is left to the caller.
    FrictionProblem(const Program& p, Workspace& w, std::vector<int> elements);
    // Room for a problem that changes with every step.
    FrictionProblem(const Program& p, const std::vector<int>& elements);
    // The same as the first at half the cost, where few forces are asked for their motion: W = X^T X by the scaled
    // responses X.
    void respond_in_step(const Program& p, Workspace& w);
    // Acceleration by friction forces.
    void acceleration(const Program& p, Workspace& w, const VecX& f, VecX& a) const;

    // Rows A x of the elements' directions.
    VecX along(const Program& p, Workspace& w, const VecX& x) const;
    void along(const Program& p, Workspace& w, const VecX& x, VecX& out) const;
    // Slip accelerations A a - b of the motion at hand.
    VecX slip_accelerations(const Program& p, Workspace& w) const;
    // C += A^T f; each element's part of f becomes its slip force.
    void add_forces(const Program& p, Workspace& w, const VecX& f, VecX& C) const;
    // W as theory has it: symmetric, and exactly zero for what the constraints alone decide, such as the friction of a
    // driven joint.
    void clean(const Program& p, Workspace& w);

private:
    template <class Act>
    void each_unit_force(const Program& p, const Workspace& w, const Act& act);
    void respond(const Program& p, Workspace& w);
    void drop_held(int row, double unconstrained);
};

// W = X^T X of the first n columns.
void gram(const MatX& X, int n, MatX& W);

}  // namespace pn
