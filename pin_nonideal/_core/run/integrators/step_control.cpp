#include "run/integrators/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pn {

namespace {

// Return the rounding error of an acceleration at the sine s to a singular position, with pivot = s^2. Unit roundoff grows
// by 1/s in the position, by 1/s^2 in the velocity after projection, and by 1/s^3 in the solution of the rows.
double rounding_at(double pivot) { return std::numeric_limits<double>::epsilon() / (pivot * std::sqrt(pivot)); }

}  // namespace

double StepControl::aim(const Method& method) { return std::pow(parameters.safety, method.order); }

bool StepControl::needs_detour(double min_pivot, double start_pivot, double end_pivot) const {
    const double way = std::sqrt(start_pivot) + std::sqrt(end_pivot);
    return method_.adaptive() && trials_.detours < parameters.max_detours &&
           std::sqrt(min_pivot) < parameters.clearance * way && rounding_at(min_pivot) > rtol_;
}

bool StepControl::accepts(std::optional<double> error, double size, bool last, double& h) {
    const double power = -1.0 / method_.order;
    if (!error) {
        ++trials_.detours;
        h = parameters.detour * size;
        return false;
    }
    if (!(*error <= 1.0)) {
        trials_.last_rejected = true;
        h = size * std::max(parameters.min_step_ratio,
                            std::isfinite(*error) ? parameters.retry_safety * std::pow(*error, power) : 0.0);
        return false;
    }
    if (method_.adaptive()) {
        double factor = parameters.max_step_ratio;
        if (*error > 0.0) factor = std::min(factor, parameters.safety * std::pow(*error, power));
        if (trials_.last_rejected) factor = std::min(1.0, factor);
        if (!(last && factor * size < h)) h = size * std::max(factor, parameters.min_step_ratio);
    }
    trials_.last_rejected = false;
    trials_.detours = 0;
    return true;
}

}  // namespace pn
