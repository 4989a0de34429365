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
    std::vector<std::int8_t> modes;  // modes of the elements over each step
    // Slip directions of all elements at each point, if an element has several directions. A step that did not solve for
    // slip directions stores the directions at the step's end.
    std::vector<double> directions;
    std::vector<std::int8_t> sought;  // whether the step solved for the directions
    std::vector<double> torque;  // torque held over each step, NaN if none, empty if the run holds none
    std::vector<double> moved;   // total energy change by projections at the end of each step [J]
};

class DenseRecorder {
public:
    // Number of points in each step, at least the number of coefficients of the interpolant.
    static int points(const Method& method) { return method.outside() ? 13 : 8; }
    // Return the position of a point, as a part of the step.
    static double part(int point, int points);

    DenseRecorder(System& system, Stepper& stepper, bool holds_torque, DenseOutput& out);

    // Record the step just taken. This leaves the workspace at other states.
    void step(double numerical_energy);
    // Record a step of time stepping as a straight line between both states.
    void straight(double t0, const VecX& y0, double t1, const VecX& y1, double numerical_energy);

private:
    void state_at_point();
    void rest_of_step(double t0, double t1, double numerical_energy, bool sought);

    System& system_;
    Stepper& stepper_;
    const bool holds_torque_, turns_;  // the run holds torques, the scene has elements with several directions
    DenseOutput& out_;
    VecX state_;
};

}  // namespace pn
