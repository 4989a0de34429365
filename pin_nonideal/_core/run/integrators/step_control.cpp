#include "run/integrators/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pn {

namespace {

// The next step aims at error = safety^order. The change of the error from step to step then seldom rejects a step.
// With 0.9 a third of the steps fails, and smooth motions need a sixth more evaluations for the same error. The error
// of a retried step is given, so it aims closer.
constexpr double safety = 0.65, retry_safety = 0.9, shrink_limit = 0.2, growth_limit = 10.0;

// Return the rounding of an acceleration at the sine s to a singular position, with pivot = s^2. Unit roundoff grows by
// 1/s in the position, by 1/s^2 in the velocity after projection, and by 1/s^3 in the solution of the rows.
double rounding_at(double pivot) { return std::numeric_limits<double>::epsilon() / (pivot * std::sqrt(pivot)); }
// A step is shortened by `detour` if an evaluation is nearer to a singular position than `clearance` times the length
// of the step's path. Its evaluations are then at other positions.
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
