// Reason why an evaluation or a run failed. The bindings convert it to the exceptions of the package.
#pragma once

#include <algorithm>
#include <exception>
#include <initializer_list>
#include <optional>
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
    std::vector<int> elements;  // dofs, blocks or friction elements, by kind
    double value = 0.0;         // residual, gap, determinant, rate or number of steps
    // Solutions of a paradox. Two of several solutions are stored: limits of the elements, and accelerations.
    enum class Solutions { unproven, none, several } solutions = Solutions::unproven;
    std::vector<VecX> limits, accelerations;
    Failure(Kind k, double t, std::vector<int> e = {}, double x = 0.0)
        : kind(k), time(t), elements(std::move(e)), value(x) {}
};

// Failure that ends a run whatever the search in which it occurs: an interrupt, or the limit of the wall time.
struct EndOfRun {
    Failure failure;
};

// Call act() and return its failure, if any. Searches test this status. Only whole runs and the bindings catch failures.
// An EndOfRun passes through.
template <class Act>
std::optional<Failure> attempt(const Act& act) {
    try {
        act();
    } catch (const Failure& failure) {
        return failure;
    }
    return std::nullopt;
}

// Call act() and return its failure if it is of one of these kinds. Other failures pass through.
template <class Act>
std::optional<Failure> attempt(std::initializer_list<Failure::Kind> kinds, const Act& act) {
    try {
        act();
    } catch (const Failure& failure) {
        if (std::find(kinds.begin(), kinds.end(), failure.kind) == kinds.end()) throw;
        return failure;
    }
    return std::nullopt;
}

}  // namespace pn
