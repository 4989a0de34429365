// Samples inside the steps of a finished run, from its dense output.
#pragma once

#include <vector>

#include "run/output/recorder.hpp"

namespace pn {

// Polynomials of steps, with `points` states of `size` numbers per step.
class StepPolynomials {
public:
    StepPolynomials(const double* states, int points, int size);

    // Compute the state at this fraction of a step. [Berrut, Trefethen, "Barycentric Lagrange interpolation", SIAM Review 46
    // (2004), eq. 4.2, 5.4]
    void at(size_t step, double part, double* out) const;

private:
    const double* states_;
    const int points_, size_;
    std::vector<double> places_, weights_;  // of the points
};

// States inside steps, each with the modes, closed contacts and torques of its step.
struct InsideStates {
    std::vector<double> t, moved, impacts;  // times, and total energy changes due to projections and impacts
    std::vector<VecX> y, torque;
    std::vector<int> turning;      // elements with slip directions
    std::vector<VecX> directions;  // slip directions of these elements
    std::vector<std::vector<char>> sought, closed;  // elements for whose directions the step solved; closed gaps
    std::vector<std::vector<Mode>> modes;
    double end = HUGE_VAL;  // end of the run [s]
};
// Project the states onto the constraints, and sample them.
void sample_inside(const Program& p, Workspace& w, const InsideStates& inside, const RecordOptions& options,
                   Recording& out);

}  // namespace pn
