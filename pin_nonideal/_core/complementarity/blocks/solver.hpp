// Solver of contact and friction on separate trees, island by island.
#pragma once

#include "complementarity/blocks/interior_point.hpp"
#include "complementarity/cone/solver.hpp"

namespace pn {

struct BlockSolverParameters {
    double tolerance = 1e-9;  // error of a solution; Newton's method mostly reaches rounding error, which is far smaller
    // Error that is accepted without a search from zero forces, which would cost twenty factorizations.
    double near_tolerance = 1e-8;
    double shared_tolerance = 1e-6;   // error of a solution with `shared_compliance`
    double shared_compliance = 1e-4;  // compliance that makes shares of a load unique, relative to an element's own response
    int min_sharing = 4;              // least number of elements of an island whose shares are made unique
    // Maximum rounds of sweeps, and sweeps of a round.
    int max_sweep_rounds = 2, sweeps_per_round = 50;
    double min_swept_error = 1e-2;  // error from which sweeps from no forces replace the best forces found
    int last_sweeps = 400;          // number of these sweeps
    double rest_speed = 1e-9;       // speed of elements at rest, relative to the largest without forces
    double path_rest_speed = 1e-3;  // speed of an island at rest at the end of the central path
    // Steps in an island, times its elements, after which no other search begins: about 100 ms. The bound is a count
    // instead of a time, so that runs stay the same.
    int max_work = 100000;
};

class BlockSolver {
public:
    using Parameters = BlockSolverParameters;
    static constexpr Parameters parameters{};

    BlockProblem problem;  // nodes, elements and offset are set by the caller

    // Prepare the problem once its nodes and elements are set. Return false if an inertia is not positive definite.
    bool pose();
    // Set the motion without forces, per unknown of the whole scene, and add the motion due to constant forces.
    void release(const VecX& free, const VecX& constant);
    // Solve for the forces f from a guess, usually those of the last step. Return the largest error of an element,
    // relative to its forces, and at least `min_swept_error` for forces of sweeps. The contacts of a single node share its
    // load as equally compliant contacts do, so that their forces depend on the problem alone. Between several nodes
    // shares stay close to the guess.
    double solve(VecX& f);
    // Hold the elements that rest, in islands whose contacts all rest, if forces within the cones can hold them. Newton's
    // method may find a motion where rest is possible as well. f are the forces of `solve`. Return false if elements of
    // such an island cannot be held.
    bool hold(VecX& f);
    // Compute the motion under the forces f. After `solve` the motion under its forces is known already.
    void move(const VecX& f);
    // Errors of the laws at the last motion. Velocities are relative to those without forces, or to an element's own
    // response to its forces if that is larger.
    ConeResiduals residuals(const VecX& f) const;

    // Element with the largest error of the laws in its own units, and this error as a velocity.
    struct Miss { int element = -1; double velocity = 0.0; };
    const Miss& miss() const { return miss_; }
    double error() const { return error_; }  // largest relative error of an element
    int newton_steps() const { return newton_.steps(); }
    // Response of a row to its own force.
    double own_response(int row, const VecX& f) const { return f[row] / newton_.stiffness(row); }
    // Write the last motion into x, on the nodes.
    void motion(VecX& x) const;
    const VecX& w() const { return w_; }  // rows of the last motion

private:
    double solve(int island, VecX& f);
    double solve_within_energy(int island, VecX& f);
    bool share(int island, VecX& f);
    bool hold(int island, VecX& f);
    bool may_hold(const Island& island) const;
    bool rests(const Island& island) const;
    void find_worst(const VecX& f);
    void begin(int island);
    void clear(int island, VecX& f) const;
    void copy(const Island& island, const VecX& from, VecX& to) const;
    bool unloads(int island, const VecX& f) const;
    bool settle(int island, VecX& f);
    bool search_from_path(int island, BlockInteriorPoint::Slip slip, VecX& f);
    bool attempt(int island, VecX& f);
    bool adds_energy(int island, const VecX& f);
    double sweep(int island, VecX& f);
    double newton(int island, BlockNewton::Search search, double compliance, VecX& f);

    int steps() const { return newton_.steps() + path_.steps(); }

    BlockNewton newton_;
    BlockInteriorPoint path_;
    mutable VecX on_nodes_;
    VecX guess_, best_, swept_, free_rows_;  // free_rows_: w under no forces
    double least_ = 0.0;  // error of best_
    int last_step_ = 0;   // step after which no other search begins
    Islands islands_;
    std::vector<BlockFactor> factors_;  // one for each island
    VecX x_, w_;  // motion in the unknowns of the problem, and its rows
    std::vector<double> errors_;  // per island
    double error_ = 0.0;          // largest of them
    Miss miss_;
    double free_speed_ = 0.0;  // largest of free_rows_
};

}  // namespace pn
