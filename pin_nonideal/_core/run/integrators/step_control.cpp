#include "run/integrators/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pn {

namespace {

// The next step aims at error = safety^order, so far below the tolerance that what the motion adds to the error from
// one step to the next seldom rejects it: over smooth motions a sixth fewer evaluations to the same error than with 0.9,
// where a third of the steps fails. A step tried again knows its error, and aims closer.
constexpr double safety = 0.65, retry_safety = 0.9, shrink_limit = 0.2, growth_limit = 10.0;

// Unit roundoff in an acceleration at a sine s to a singular position: 1/s of it in the place, 1/s^2 in the velocity
// after projection, 1/s^3 where the rows are solved.
double rounding_at(double pivot) { return std::numeric_limits<double>::epsilon() / (pivot * std::sqrt(pivot)); }
// A step whose evaluations come nearer than this part of its way through is shortened so, which moves them elsewhere.
constexpr double clearance = 0.04, detour = 0.85;
constexpr int detour_limit = 3;

}  // namespace

double StepControl::aim(const Method& method) { return std::pow(safety, method.order); }

bool StepControl::needs_detour(double least_pivot, double start_pivot, double end_pivot) const {
    const double way = std::sqrt(start_pivot) + std::sqrt(end_pivot);
    return method_.adaptive() && detours_ < detour_limit && std::sqrt(least_pivot) < clearance * way &&
           rounding_at(least_pivot) > rtol_;
}

bool StepControl::accepts(std::optional<double> error, double size, bool last, double& h) {
    const double power = -1.0 / method_.order;
    if (!error) {
        ++detours_;
        h = detour * size;
        return false;
    }
    if (!(*error <= 1.0)) {
        last_rejected_ = true;
        h = size * std::max(shrink_limit, std::isfinite(*error) ? retry_safety * std::pow(*error, power) : 0.0);
        return false;
    }
    if (method_.adaptive()) {
        double factor = growth_limit;
        if (*error > 0.0) factor = std::min(factor, safety * std::pow(*error, power));
        if (last_rejected_) factor = std::min(1.0, factor);
        if (!(last && factor * size < h)) h = size * std::max(factor, shrink_limit);
    }
    last_rejected_ = false;
    detours_ = 0;
    return true;
}

}  // namespace pn
