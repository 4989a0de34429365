// Roots and minima of event functions (margins), as functions of the fraction of a step.
#pragma once

#include <algorithm>
#include <cmath>

namespace pn {

struct RootSearchParameters {
    int max_dip_passes = 40;   // golden sections, which find a dip of 1e-16 of the margin's change
    int max_root_passes = 60;  // maximum secants and bisections, of which 44 bisections reach `root_width`
    int start_halvings = 30;   // halvings toward the start, near which a slip from rest may stop again
    double root_width = 1e-13, root_margin = 1e-13;  // the root is a guess for the repeated step
    double margin_slope_step = 1e-4;  // step of the difference for the rate of a margin, relative to the step
};

inline constexpr RootSearchParameters root_search_parameters{};

constexpr double no_crossing = 2.0;  // fraction of a step that stands for no crossing

// Return the root of a margin that is positive at `low` and negative at `high`, as fractions of a step. Uses secants that
// stay inside the bracket (Illinois).
template <class Margin>
double root_between(double low, double margin_low, double high, double margin_high, const Margin& margin) {
    if (margin_low <= 0.0) return low;  // the margin starts at zero and falls at once
    int side = 0;
    for (int it = 0; it < root_search_parameters.max_root_passes && high - low > root_search_parameters.root_width; ++it) {
        double mid = (low * margin_high - high * margin_low) / (margin_high - margin_low);
        if (!(mid > low && mid < high)) mid = 0.5 * (low + high);
        const double margin_mid = margin(mid);
        if (std::abs(margin_mid) < root_search_parameters.root_margin) return mid;
        if (margin_mid > 0.0) {
            low = mid;
            margin_low = margin_mid;
            if (side == 1) margin_high *= 0.5;
            side = 1;
        } else {
            high = mid;
            margin_high = margin_mid;
            if (side == -1) margin_low *= 0.5;
            side = -1;
        }
    }
    return high;
}

// Return the root of a margin that is zero at the start. If the margin rises above `least` before it falls, the later
// root is returned. Otherwise the margin falls at once, and the start is returned.
template <class Margin>
double root_after_start(double high, double margin_high, double least, const Margin& margin) {
    for (int it = 0; it < root_search_parameters.start_halvings; ++it) {
        const double low = 0.5 * high, margin_low = margin(low);
        if (margin_low > least) return root_between(low, margin_low, high, margin_high, margin);
        high = low;
        margin_high = margin_low;
    }
    return 0.0;
}

// Return a lower bound on [0, 1] of the cubic with values u0, u1 and slopes a0, a1 at 0 and 1. The bound is the minimum of
// the Bernstein coefficients.
inline double lower_bound_inside(double u0, double a0, double u1, double a1) {
    constexpr double third = 1.0 / 3.0;
    return std::min({u0, u0 + third * a0, u1 - third * a1, u1});
}

// Return the least extremum of the same cubic inside (0, 1), or HUGE_VAL if there is none.
inline double min_inside(double u0, double a0, double u1, double a1) {
    // u' = a0 + 2 b x + 3 c x^2
    const double b = 3.0 * (u1 - u0) - 2.0 * a0 - a1, c = a0 + a1 - 2.0 * (u1 - u0);
    const double root = std::sqrt(b * b - 3.0 * a0 * c);  // NaN: no extremum
    const double q = -(b + std::copysign(root, b));
    double lowest = HUGE_VAL;
    for (double x : {q / (3.0 * c), a0 / q})  // maximum and minimum in either order
        if (x > 0.0 && x < 1.0) lowest = std::min(lowest, u0 + x * (a0 + x * (b + x * c)));
    return lowest;
}

// Return the height of the parabola through three points above the highest of them, or 0 if none lies between them.
inline double rise_between(double t0, double u0, double t1, double u1, double t2, double u2) {
    const double first = (u1 - u0) / (t1 - t0), second = ((u2 - u1) / (t2 - t1) - first) / (t2 - t0);
    if (!(second < 0.0)) return 0.0;
    const double top = 0.5 * (t0 + t1 - first / second);
    if (!(top > t0 && top < t2)) return 0.0;
    const double peak = u0 + (top - t0) * (first + second * (top - t1));
    return std::max(0.0, peak - std::max({u0, u1, u2}));
}

// Return a point between a and b at which the margin is negative, by golden sections toward its minimum. `value` is the
// margin at this point. Return b if no such point is found.
template <class Margin>
double dip_between(double a, double b, const Margin& margin, double& value) {
    constexpr double golden = 0.3819660112501051;
    const double end = b;
    double x1 = a + golden * (b - a), x2 = b - golden * (b - a), g1 = margin(x1), g2 = margin(x2);
    for (int it = 0; it < root_search_parameters.max_dip_passes; ++it) {
        if (std::min(g1, g2) < 0.0) {
            value = std::min(g1, g2);
            return g1 < g2 ? x1 : x2;
        }
        if (g1 < g2) {
            b = x2; x2 = x1; g2 = g1;
            g1 = margin(x1 = a + golden * (b - a));
        } else {
            a = x1; x1 = x2; g1 = g2;
            g2 = margin(x2 = b - golden * (b - a));
        }
    }
    return end;
}

}  // namespace pn
