// Reason why an evaluation or a run failed. The bindings convert it to the exceptions of the package.
#pragma once

#include <exception>
#include <utility>
#include <vector>

#include "math/spatial.hpp"

namespace pn {

struct Failure : std::exception {
    enum class Kind {
        singular_mass, inconsistent, not_finite, paradox, not_converged, closure, step_size, stiff, steps, wall,
        interrupted, impact_energy, growing, unmet_law
    };
    Kind kind;
    double time = 0.0;
    std::vector<int> elements;  // dofs, blocks or frictions, depending on the kind
    double value = 0.0;         // residual, gap, determinant, rate or number of steps
    // Solutions of a paradox. Two of several solutions are stored: limits of the elements, and accelerations.
    enum class Solutions { not_told, none, several } solutions = Solutions::not_told;
    std::vector<VecX> limits, accelerations;
    Failure(Kind k, double t, std::vector<int> e = {}, double x = 0.0)
        : kind(k), time(t), elements(std::move(e)), value(x) {}
};

// Failure that ends a run whatever the search in which it occurs. No search may catch it.
struct EndOfRun {
    Failure failure;
};

}  // namespace pn
