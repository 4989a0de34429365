// Functions of time that return value, rate and acceleration.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <variant>
#include <vector>

namespace pn {

using Jet = std::array<double, 3>;  // value, first and second derivative

struct Sinusoid {
    double amplitude, frequency, phase, offset;
    Jet operator()(double t) const {
        const double s = std::sin(frequency * t + phase), c = std::cos(frequency * t + phase);
        return {offset + amplitude * s, amplitude * frequency * c, -amplitude * frequency * frequency * s};
    }
};

struct Polynomial {
    std::vector<double> coefficients;  // low to high
    Jet operator()(double t) const {
        Jet y{0.0, 0.0, 0.0};
        for (auto c = coefficients.rbegin(); c != coefficients.rend(); ++c) {
            y[2] = y[2] * t + 2.0 * y[1];
            y[1] = y[1] * t + y[0];
            y[0] = y[0] * t + *c;
        }
        return y;
    }
};

struct Spline {  // piecewise cubic polynomials of (t - break), with the end values outside
    std::vector<double> breaks, coefficients;  // 4 per piece, low to high
    Jet operator()(double t) const {
        const bool outside = t < breaks.front() || t > breaks.back();
        t = std::clamp(t, breaks.front(), breaks.back());
        const auto next = std::upper_bound(breaks.begin() + 1, breaks.end() - 1, t);
        const size_t k = next - breaks.begin() - 1;
        const double s = t - breaks[k], *c = coefficients.data() + 4 * k;
        const double value = c[0] + s * (c[1] + s * (c[2] + s * c[3]));
        if (outside) return {value, 0.0, 0.0};
        return {value, c[1] + s * (2.0 * c[2] + s * 3.0 * c[3]), 2.0 * c[2] + 6.0 * s * c[3]};
    }
};

using TimeFunction = std::variant<Polynomial, Sinusoid, Spline, std::function<Jet(double)>>;

inline bool is_constant(const TimeFunction& f) {
    const auto* polynomial = std::get_if<Polynomial>(&f);
    return polynomial && polynomial->coefficients.size() <= 1;
}

// Return the times at which the pieces of a function meet. The derivatives of the function may jump at these times. None are
// known for a user's function.
inline std::vector<double> breaks(const TimeFunction& f) {
    const auto* spline = std::get_if<Spline>(&f);
    return spline ? spline->breaks : std::vector<double>();
}

inline bool is_users(const TimeFunction& f) { return std::holds_alternative<std::function<Jet(double)>>(f); }

inline Jet evaluate(const TimeFunction& f, double t) {
    return std::visit([t](const auto& g) { return g(t); }, f);
}

}  // namespace pn
