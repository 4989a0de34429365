// Integration methods as data. A new explicit Runge-Kutta pair needs one table and one name in method.cpp. The core
// follows the steps of methods outside the core.
#pragma once

#include <string>
#include <vector>

namespace pn {

// Maximum number of rates: stages, rate at the step's end, and further stages of the interpolant.
constexpr int max_rates = 16;

struct Method {
    enum class Scheme { runge_kutta, semi_implicit_euler, moreau, outside };

    const char* name = nullptr;
    Scheme scheme = Scheme::runge_kutta;
    int order = 1, stages = 1;
    const double *A = nullptr, *B = nullptr, *C = nullptr;  // rows of A below the diagonal, in sequence

    // Weights of the error estimate over the stages. The weights include the rate at the step's end if it is the first stage
    // of the next step (first same as last). A second, coarser estimate guards against zeros of the first.
    const double *E = nullptr, *E_coarse = nullptr;
    bool first_same_as_last = false;
    double stability = 0.0;  // stability limit of a step, in units of the time in which a motion decays
    bool one_step = true;    // uses no earlier steps, so it can continue from a projected state

    // The interpolant has one of two forms:
    // - the cubic through both ends and their rates, plus terms of weights D over all rates, including further stages,
    // - a polynomial in the fraction of the step, with coefficients P.
    int further_stages = 0, terms = 0, powers = 0;
    const double *A_further = nullptr, *C_further = nullptr, *D = nullptr, *P = nullptr;

    bool outside() const { return scheme == Scheme::outside; }
    bool adaptive() const { return E != nullptr || outside(); }
    int rates() const { return stages + 1 + further_stages; }
};

const std::vector<Method>& methods();
const Method& method_named(const std::string& name);

}  // namespace pn
