// Mean velocity of a time step, at which its forces are taken.
#pragma once

#include <Eigen/Geometry>

#include "dynamics/workspace.hpp"

namespace pn {

struct MeanVelocityParameters {
    // Change of the configuration in a step that counts as rounding error [rad, or radius of the tree].
    double configuration_rounding = 1e-13;
    // Change in a sweep below which no sweep follows. Rounding decides if changes near this tolerance exceed it. The
    // velocity at the step's end then differs by a small part of tolerance / h. Sweeps of contacts cost more.
    double configuration_tolerance = 1e-12, contact_tolerance = 1e-9;
    int max_sweeps = 6;  // maximum number of sweeps of a step
    // Slip of an element held by constraints that counts as rounding error, relative to the velocities of the step.
    double held_rounding = 1e-12;
    // Maximum error of a prediction of the last rate, relative to this rate, for the next rate to be predicted.
    double max_unpredicted = 0.1;
};

// Sweeps compute the mean of the velocities at the start and at the end of a step, which depends on the forces. The first
// sweep takes the forces at a prediction from the rates of the last steps. The prediction is constant, linear or none, by
// its error in the last step.
//
// The linear velocity v of a free flyer is given in axes that turn with it. Inside a step it is given in the axes at the
// middle of the step, so that the velocity u = v + w x c of its center of mass c keeps its direction in space. In these
// axes the rate of v is the acceleration plus w x u: a body that rolls or flies keeps its speed and momentum while it
// turns.
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

    // Begin a step of length h at the velocity v0, after steps with these rates.
    void begin(double h, const VecX& v0, const VelocityRates& last);
    // Return to the mean of the first sweep.
    void restart();
    // Add the rate of this step.
    void keep_rate(VelocityRates& last) const;
    // Compute the velocity at the step's end for the acceleration a.
    void end(const VecX& a, VecX& v1);
    // Set the mean to the average of the velocities at the step's start and end. Return false if no further sweep is
    // needed. `touches`: contacts take part.
    bool move(bool touches);

    bool is_predicted() const { return is_predicted_; }  // the first sweep is at another velocity than the start
    const VecX& value() const { return value_; }  // velocity at which the forces are taken
    const VecX& start() const { return start_; }  // velocity of the start, in the axes at the middle of the step
    const VecX& finish() const { return end_; }   // velocity of the end, in these axes
    // Compute the rates of a block's kept rows at the velocity of the start, and half of their change due to turning axes.
    // The rows are evaluated at the mean velocity. The rates are stored in w.scratch.r at the block's rows.
    void start_rates(const Program& p, Workspace& w, int block) const;
    // Check if a friction element has no slip at the velocity of the start, up to rounding.
    bool starts_at_rest(const Program& p, Workspace& w, const Friction& friction) const;
    // Return the slip, divided by the step's length, that counts as rounding error, for the acceleration a without friction.
    double held_slip(const Program& p, const VecX& a) const;
    // Set the right-hand sides b that satisfy the constraints at the end of the step. The rows are evaluated at the
    // middle of the step, so half of their change over the step remains.
    void meet_at_end(const Program& p, Workspace& w, VecX& b) const;

private:
    void measure();
    void predict(const VelocityRates& last);
    // Largest entry, in units of its dof.
    template <class X>
    double size(const X& x) const { return x.cwiseQuotient(unit_).cwiseAbs().maxCoeff(); }

    std::vector<FreeFlyer> flyers_;
    VecX unit_;  // per dof
    double h_ = 0.0;
    VecX value_, first_, start_, end_, next_;
    VecX turning_;  // rates of the linear velocities due to turning axes
    VecX start_difference_;     // velocity of the start minus mean, plus h/2 of these rates
    int moves_ = 0;  // sweeps after the first one
    bool is_predicted_ = false;
};

}  // namespace pn
