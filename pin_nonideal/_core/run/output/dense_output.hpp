// Dense output: the interpolant of every step by its values at Chebyshev's points, through which one polynomial goes, and
// what else a sample inside the step needs.
#pragma once

#include <cstdint>
#include <vector>

#include "run/integrators/stepper.hpp"

namespace pn {

struct DenseOutput {
    std::vector<double> times;   // start and end of each step
    std::vector<double> states;  // y without watch at each point, step by step
    std::vector<std::int8_t> modes;  // of the elements over each step
    // Directions of each element's slip, where any has several: at each point of a step that sought them, else by its end.
    std::vector<double> directions;
    std::vector<std::int8_t> sought;  // whether the step sought them
    std::vector<double> torque;  // held over each step, not a number where none is; or nothing where none ever is
    std::vector<double> moved;   // energy moved by projection up to the end of each step
};

class DenseRecorder {
public:
    // Points in each step: as many as the interpolant has coefficients, at least.
    static int points(const Method& method) { return method.outside() ? 13 : 8; }
    // Where one of them lies in the step.
    static double part(int point, int points);

    DenseRecorder(System& system, Stepper& stepper, bool holds_torque, DenseOutput& out);

    // The step just taken. Leaves the workspace at other states.
    void step(double moved_energy);
    // A step of time stepping: straight from the one state to the other.
    void straight(double t0, const VecX& y0, double t1, const VecX& y1, double moved_energy);

private:
    void state_at_point();
    void rest_of_step(double t0, double t1, double moved_energy, bool sought);

    System& system_;
    Stepper& stepper_;
    const bool holds_torque_, turns_;  // held torques, and elements of several directions, are in the scene
    DenseOutput& out_;
    VecX state_;
};

}  // namespace pn
