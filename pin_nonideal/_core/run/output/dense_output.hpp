// Dense output: interpolant of every step, and other data that a sample inside the step needs. The interpolant is
// stored by its values at Chebyshev points, which define one polynomial.
#pragma once

#include <cstdint>
#include <vector>

#include "run/integrators/stepper.hpp"

namespace pn {

struct DenseOutput {
    std::vector<double> times;   // start and end of each step
    std::vector<double> states;  // y without watch at each point, step by step
    std::vector<std::int8_t> modes;   // modes of the elements over each step
    std::vector<std::int8_t> closed;  // whether each gap is closed over each step
    // Elements of several directions with a load, step by step, and their number in each step.
    std::vector<std::int32_t> turning, turning_counts;
    // Slip directions of these elements at each point of each step. A step that did not solve for slip directions stores
    // the directions at the step's end.
    std::vector<double> directions;
    std::vector<std::int8_t> sought;  // whether the step solved for the directions
    std::vector<double> torque;  // torque held over each step, NaN if none, empty if the run holds none
    std::vector<double> moved;   // total energy change due to projections at the end of each step [J]
    std::vector<double> impacts;  // total energy change due to impacts at the start and at the end of each step [J]
};

class DenseRecorder {
public:
    // Number of points in each step, at least the number of coefficients of the interpolant.
    static int points(const Method& method) { return method.outside() ? 13 : 8; }
    // Return the position of a point, as a fraction of the step.
    static double part(int point, int points);

    DenseRecorder(System& system, Stepper& stepper, bool holds_torque, DenseOutput& out);

    // Total energy changes since the start of the run [J].
    struct EnergyChanges {
        double projections, impacts_before, impacts;  // impacts: at the start and at the end of the step
    };
    // Record the step just taken. This leaves the workspace at other states.
    void step(const EnergyChanges& changes);
    // Record a step of time stepping from (t0, y0) as a straight line between both states. Inside the step contacts are
    // closed, and elements stick, if they do at its start and at its end.
    struct StepStart {
        double t;
        const VecX& y;
        const std::vector<char>& closed;
        const Modes& mode;
    };
    void straight(const StepStart& start, double t1, const VecX& y1, const EnergyChanges& changes);

private:
    void find_turning();
    void state_at_point();
    void rest_of_step(double t0, double t1, const EnergyChanges& changes, bool sought);

    System& system_;
    Stepper& stepper_;
    const bool holds_torque_;  // the run holds torques
    DenseOutput& out_;
    std::vector<int> turning_;  // elements of several directions with a load in the step
    VecX state_;
};

}  // namespace pn
