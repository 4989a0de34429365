#include "run/integrators/runge_kutta.hpp"

#include "math/lanes.hpp"

namespace pn {

// Compute out = y + (part_0 K_0 + ... + part_{n-1} K_{n-1}) for the entries from i that `Several` holds.
template <class Several>
static PN_INLINE void add_weighted_at(int i, const VecX& y, const double* part, const WeightedSum& sum, VecX& out) {
    Several x, k;
    load(y.data() + i, x);
    for (int j = 0; j < sum.terms; ++j) {
        load(sum.rate[j] + i, k);
        x += part[j] * k;
    }
    store(x, out.data() + i);
}

PN_WIDE void add_weighted(int size, const VecX& y, double h, const WeightedSum& sum, VecX& out) {
    double part[max_rates];
    for (int j = 0; j < sum.terms; ++j) part[j] = h * sum.weight[j];
    int i = 0;
    for (; i + 3 < size; i += 4) add_weighted_at<Lanes>(i, y, part, sum, out);
    if (i + 1 < size) {
        add_weighted_at<TwoLanes>(i, y, part, sum, out);
        i += 2;
    }
    if (i < size) add_weighted_at<double>(i, y, part, sum, out);
}

WeightedSum::WeightedSum(const double* weights, int n, const std::vector<VecX>& rates) {
    for (int j = 0; j < n; ++j) {
        if (weights[j] == 0.0) continue;
        weight[terms] = weights[j];
        rate[terms++] = rates[j].data();
    }
}

RungeKutta::RungeKutta(const Method& method, Step& step)
    : method_(method), step_(step), stage_(step.y0), error_(step.y0), to_end_(method.B, method.stages, step.rates) {
    const int stages = method.stages, at_end = stages + 1;
    const double* a = method.A;
    for (int i = 1; i < stages; a += i++) to_stage_.emplace_back(a, i, step.rates);
    for (const double* weights : {method.E, method.E_coarse})
        if (weights) to_errors_.emplace_back(weights, method.first_same_as_last ? at_end : stages, step.rates);
    a = method.A_further;
    for (int i = at_end; i < method.rates(); a += i++) to_further_.emplace_back(a, i, step.rates);
    for (int i = 0; i < method.terms; ++i)
        to_terms_.emplace_back(method.D + method.rates() * i, method.rates(), step.rates);
    for (int i = 0; i < method.powers; ++i) {
        double weights[max_rates];
        for (int j = 0; j < stages; ++j) weights[j] = method.P[method.powers * j + i];
        to_terms_.emplace_back(weights, stages, step.rates);
    }
    coefficients_.assign(method.P ? method.powers : 3 + method.terms, step.y0);
}

void RungeKutta::sum_powers() {
    const int n = step_.active;
    for (int i = 0; i < method_.powers; ++i) {
        coefficients_[i].head(n) = (step_.h * method_.P[method_.powers * step_.stages + i]) * step_.end_rate().head(n);
        add_weighted(n, coefficients_[i], step_.h, to_terms_[i], coefficients_[i]);
    }
}

void RungeKutta::sum_terms() {
    const int n = step_.active;
    auto delta = coefficients_[0].head(n);
    delta = step_.y1.head(n) - step_.y0.head(n);
    coefficients_[1].head(n) = step_.h * step_.start_rate().head(n) - delta;
    coefficients_[2].head(n) = 2.0 * delta - step_.h * (step_.end_rate().head(n) + step_.start_rate().head(n));
    for (int i = 0; i < method_.terms; ++i) {
        coefficients_[3 + i].head(n).setZero();
        add_weighted(n, coefficients_[3 + i], step_.h, to_terms_[i], coefficients_[3 + i]);
    }
}

void RungeKutta::interpolate(double part, VecX& y) const {
    const int n = step_.states;
    auto sum = y.head(n);
    sum.setZero();
    for (int i = static_cast<int>(coefficients_.size()) - 1; i >= 0; --i) {
        sum += coefficients_[i].head(n);
        // Horner's scheme: factors part and 1 - part alternate, or all factors are part.
        sum *= method_.P || i % 2 == 0 ? part : 1.0 - part;
    }
    sum += step_.y0.head(n);
}

std::pair<double, double> RungeKutta::interpolated(double part, int index) const {
    double value = 0.0, change = 0.0;
    for (int i = static_cast<int>(coefficients_.size()) - 1; i >= 0; --i) {
        value += coefficients_[i][index];
        const bool forward = method_.P || i % 2 == 0;
        change = change * (forward ? part : 1.0 - part) + (forward ? value : -value);
        value *= forward ? part : 1.0 - part;
    }
    return {value + step_.y0[index], change};
}

}  // namespace pn
