// Mean velocity of a time step, at which its forces are taken.
#pragma once

#include <Eigen/Geometry>

#include "dynamics/workspace.hpp"

namespace pn {

struct MeanVelocityParameters {
    // Change of the configuration in a step that counts as rounding [rad, or radius of the tree].
    double configuration_rounding = 1e-13;
    // Change by a further sweep below which no sweep follows. The second sweep makes the step second order. Fast motion
    // needs more sweeps to conserve its energy.
    double configuration_tolerance = 1e-9;
    int max_sweeps = 4;  // maximum number of sweeps of a step
};

// The mean of the velocities at the start and at the end of a step depends on the forces. Sweeps find it: the first one
// takes the forces at the velocity of the start.
//
// The linear velocity v of a free flyer is given in axes that turn with it. Inside a step it is given in the axes at the
// middle of the step, so that the velocity u = v + w x c of its center of mass c keeps its direction in space. Its rate
// there is the acceleration plus w x u: a body that rolls or flies keeps its speed and momentum while it turns.
class MeanVelocity {
public:
    using Parameters = MeanVelocityParameters;
    static constexpr Parameters parameters{};

    struct FreeFlyer {
        int dof = 0;           // first of its six dofs
        Eigen::Vector3d com;   // center of mass of its body
        // Give the velocity in axes turned by `angle`, with the velocity of the center of mass unchanged in space.
        void turn_axes(VecX& v, const Eigen::Vector3d& angle) const;
    };
    static std::vector<FreeFlyer> flyers(const Program& p);

    explicit MeanVelocity(const Program& p);

    // Begin a step of length h at the velocity v0.
    void begin(double h, const VecX& v0);
    // Compute the velocity at the step's end for the acceleration a.
    void end(const VecX& a, VecX& v1);
    // Move the mean to that of the step's start and end for another sweep. Return false if no further sweep is needed.
    bool move();

    const VecX& value() const { return value_; }  // velocity at which the forces are taken
    const VecX& start() const { return start_; }  // velocity of the start, in the axes at the middle of the step
    const VecX& finish() const { return end_; }   // velocity of the end, in these axes
    // Compute the rates of a block's kept rows at the velocity of the start, and half of their change by turning axes.
    // The rows are evaluated at the mean velocity. The rates are stored in w.scratch.r at the block's rows.
    void start_rates(const Program& p, Workspace& w, int block) const;
    // Slip speed of a friction element at the velocity of the start.
    double start_speed(const Program& p, Workspace& w, const Friction& friction) const;
    // Set the right-hand sides b that satisfy the constraints at the end of the step. The rows are evaluated at the
    // middle of the step, so half of their change over the step remains.
    void meet_at_end(const Program& p, Workspace& w, VecX& b) const;

private:
    void measure();

    std::vector<FreeFlyer> flyers_;
    VecX unit_;  // by dof
    double h_ = 0.0;
    VecX value_, start_, end_, next_;
    VecX turning_;  // rates of the linear velocities by turning axes
    VecX start_difference_;     // velocity of the start minus mean, plus h/2 of these rates
    int moves_ = 0;  // sweeps after the first one
};

}  // namespace pn
