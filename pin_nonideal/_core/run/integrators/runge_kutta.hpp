// Explicit Runge-Kutta methods: one stepping routine on flat arrays for all tables. A system provides
//     derivative(t, y, dy)   and   normalize(y),
// and `normalize` restores unit lengths. The norm of an error is 1 at the tolerance.
#pragma once

#include <cmath>
#include <utility>

#include "run/integrators/method.hpp"
#include "run/integrators/step.hpp"

namespace pn {

// Weighted sum of rates: nonzero weights, and pointers to their rates.
struct WeightedSum {
    int terms = 0;
    double weight[max_rates];
    const double* rate[max_rates];
    WeightedSum(const double* weights, int n, const std::vector<VecX>& rates);
};

// Compute out = y + h (a_0 K_0 + ... + a_{n-1} K_{n-1}) for the first `size` entries. `out` may be y.
void add_weighted(int size, const VecX& y, double h, const WeightedSum& sum, VecX& out);

class RungeKutta {
public:
    RungeKutta(const Method& method, Step& step);
    RungeKutta(const RungeKutta&) = delete;  // its sums point into the step's rates
    RungeKutta& operator=(const RungeKutta&) = delete;

    // Compute y1 from y0 and the rate at y0.
    template <class System>
    void advance(System& system) {
        for (int i = 1; i < method_.stages; ++i) {
            add_weighted(step_.states, step_.y0, step_.h, to_stage_[i - 1], stage_);
            system.derivative(step_.t0 + method_.C[i] * step_.h, stage_, step_.rates[i]);
        }
        add_weighted(step_.active, step_.y0, step_.h, to_end_, step_.y1);
        system.normalize(step_.y1);
    }

    // Return the norm of the error estimate.
    template <class Norm>
    double error(Norm& norm) {
        error_.head(step_.active).setZero();
        if (to_errors_.size() == 1) {
            add_weighted(step_.active, error_, step_.h, to_errors_[0], error_);
            return norm(error_, step_.y0);
        }
        double each[2];
        for (int i = 0; i < 2; ++i) {
            error_.head(step_.active).setZero();
            add_weighted(step_.active, error_, 1.0, to_errors_[i], error_);
            each[i] = norm(error_, step_.y0);
        }
        const auto [fine, coarse] = each;
        if (fine == 0.0 && coarse == 0.0) return 0.0;
        return std::abs(step_.h) * fine * fine / std::sqrt(fine * fine + coarse_part * coarse * coarse);
    }

    // Make the interpolant over the step. The rate at the step's end must be known.
    template <class System>
    void make_interpolant(System& system) {
        for (int i = 0; i < method_.further_stages; ++i) {
            add_weighted(step_.states, step_.y0, step_.h, to_further_[i], stage_);
            system.derivative(step_.t0 + method_.C_further[i] * step_.h, stage_, step_.rates[step_.stages + 1 + i]);
        }
        if (method_.P) sum_powers();
        else sum_terms();
    }
    void interpolate(double part, VecX& y) const;
    // Return one entry of the interpolant, and its rate per step.
    std::pair<double, double> interpolated(double part, int index) const;
    // State of the last stage, until the interpolant is made.
    const VecX& last_stage() const { return stage_; }

private:
    // Weight of the squared coarse estimate in the combined norm. [Hairer, Norsett, Wanner, eq. II.10.17]
    static constexpr double coarse_part = 0.01;

    void sum_powers();
    void sum_terms();

    const Method& method_;
    Step& step_;
    VecX stage_, error_;
    std::vector<WeightedSum> to_stage_, to_errors_, to_further_, to_terms_;
    WeightedSum to_end_;
    std::vector<VecX> coefficients_;  // coefficients of the interpolant
};

}  // namespace pn
