// A method of integration is data: adding an explicit Runge-Kutta pair is one table in method.cpp, and its name there.
// The steps of those that lie outside the core are followed.
#pragma once

#include <string>
#include <vector>

namespace pn {

// Stages of a method, the rate at the step's end, and further stages of its interpolant.
constexpr int most_rates = 16;

struct Method {
    enum class Scheme { runge_kutta, semi_implicit_euler, moreau, outside };

    const char* name = nullptr;
    Scheme scheme = Scheme::runge_kutta;
    int order = 1, stages = 1;
    const double *A = nullptr, *B = nullptr, *C = nullptr;  // rows of A below the diagonal, one after the other

    // Weights of the error estimate over the stages, and over the rate at the step's end where that is one too (first
    // same as last). A second, coarser one guards against zeros of the first.
    const double *E = nullptr, *E_coarse = nullptr;
    bool first_same_as_last = false;
    double stability = 0.0;  // steps are stable up to this length over the time in which a motion decays
    bool one_step = true;    // remembers no earlier steps, so that it goes on from a state that was put in place

    // The interpolant is the cubic through both ends and their rates, with further terms of weights D over all rates, of
    // further stages too; or a polynomial in the part of the step, with coefficients P.
    int further_stages = 0, terms = 0, powers = 0;
    const double *A_further = nullptr, *C_further = nullptr, *D = nullptr, *P = nullptr;

    bool outside() const { return scheme == Scheme::outside; }
    bool adaptive() const { return E != nullptr || outside(); }
    int rates() const { return stages + 1 + further_stages; }
};

const std::vector<Method>& methods();
const Method& method_named(const std::string& name);

}  // namespace pn
