// Why an evaluation or a run cannot go on: a value at the door, where the package's exceptions are made of it.
#pragma once

#include <exception>
#include <utility>
#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct Failure : std::exception {
    enum class Kind {
        singular_mass, inconsistent, not_finite, paradox, not_converged, closure, step_size, stiff, steps, wall,
        interrupted, impact_energy, growing
    };
    Kind kind;
    double time = 0.0;
    std::vector<int> elements;  // dofs, blocks or frictions, as the kind says
    double value = 0.0;         // residual, gap, determinant, rate or number of steps
    // Of a paradox: what is shown, and of several motions two, the limits of the elements and the acceleration of each.
    enum class Solutions { not_told, none, several } solutions = Solutions::not_told;
    std::vector<VecX> limits, accelerations;
    Failure(Kind k, double t, std::vector<int> e = {}, double x = 0.0)
        : kind(k), time(t), elements(std::move(e)), value(x) {}
};

}  // namespace pn
